"""Cut pictures without landmarks into worlds to train on: hard negatives of real kinds.

    python training/negatives.py OUT/pictures FOLDER FILM.mp4 --worlds 20 --start aerial.onnx

Each world gets a folder like those of `pictures.py`, and a line for each source in
``sources.json``: its name and the SHA-256 of its bytes. No source may show a pad or a tag. Most
streets show vehicles and posts: what the network to start from detects as one is neither taught as
one nor as none. Of a few parts, the one with the likeliest false pad or tag is kept.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import advice  # noqa: F401
import cv2
import numpy as np
from grounds import Canvas
from pictures import PER_WORLD, SIZE
from running import run
from shots import MOST_THINGS
from worlds import CLASSES

from ros_visualise.core.errors import OpenError
from ros_visualise.landmarks.networks.candidates import SelectionRules
from ros_visualise.landmarks.networks.network import Network

_ENDS = (".jpg", ".jpeg", ".png")
_FRAMES = 40
"""Frames taken from a film, at equal distances."""
_LONGEST = 2000  # pixels of a picture's longer side
_LEAST_PART = 96
"""Side of the smallest part that is cut out, pixels."""
_CANDIDATES = 3
"""Parts among which the hardest is chosen."""
_GRAY = 0.15
"""Fraction of the parts without colours."""
_SURE = 0.1
_UNLABELLED = ("vehicle", "post")
_QUALITY = 60, 92  # of JPEG


def files_in(sources: Sequence[Path]) -> list[Path]:
    """Pictures and films: the sources, and what is in those that are folders."""
    found = []
    for source in sources:
        inside = sorted(source.rglob("*")) if source.is_dir() else [source]
        found += [path for path in inside if not source.is_dir() or path.suffix.lower() in _ENDS]
    return found


def read_pictures(path: Path) -> list[Canvas]:
    """A picture, or frames of a film, BGR.

    Raises:
        OpenError: it is neither.
    """
    if path.suffix.lower() in _ENDS:
        picture = cv2.imread(str(path), cv2.IMREAD_COLOR)
        return [] if picture is None else [np.asarray(picture, np.uint8)]
    film = cv2.VideoCapture(str(path))
    count, frames = int(film.get(cv2.CAP_PROP_FRAME_COUNT)), []
    for number in range(count):
        if film.grab() and number % max(count // _FRAMES, 1) == 0:
            frames.append(np.asarray(film.retrieve()[1], np.uint8))
    if not frames:
        raise OpenError(f"{path}: neither a picture nor a film")
    return frames


def _shrunk(picture: Canvas) -> Canvas:
    """A picture, smaller if it is very large: it has to fit into the memory with all others."""
    scale = min(1.0, _LONGEST / max(picture.shape[:2]))
    if scale == 1:
        return picture
    small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.uint8)


def cut_part(random: np.random.Generator, picture: Canvas) -> Canvas:
    """A square part of a picture, of any size that it has, at the size of a training picture."""
    short = min(picture.shape[:2])
    low, high = np.log(min(_LEAST_PART, short)), np.log(short)
    side = int(math.exp(random.uniform(low, high)))
    y, x = (int(random.integers(0, length - side + 1)) for length in picture.shape[:2])
    part = picture[y : y + side, x : x + side]
    how = cv2.INTER_AREA if side > SIZE[0] else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(part, SIZE, interpolation=how), np.uint8)


class Part(NamedTuple):
    """A part, its rows of ``labels.json``, and the score of the likeliest false pad or tag."""

    picture: Canvas
    rows: list[list[float]]
    hardness: float


def judge(network: Network, picture: Canvas) -> Part:
    """A part with what it may show without a label; this counts as hidden."""
    found = network.detect(picture, "BGR", SelectionRules(min_score=_SURE))
    rows, hardness = [], 0.0
    for kind, box, score in zip(found.classes, found.boxes_xyxy, found.scores, strict=True):
        if network.names[int(kind)] in _UNLABELLED:
            middle, foot = float(box[0] + box[2]) / 2, float(box[3])
            rows.append([int(kind), *np.round(box, 3).tolist(), middle, foot, -1.0])
        else:
            hardness = max(hardness, float(score))
    return Part(picture, rows[:MOST_THINGS], hardness)


def write_worlds(out: Path, files: Sequence[Path], worlds: int, seed: int, start: Path) -> None:
    """Write the parts; every file is used equally often."""
    network = Network(str(start))
    pictures = [_shrunk(picture) for path in files for picture in read_pictures(path)]
    if not pictures:
        raise OpenError("no pictures to cut; give other sources")
    for world in range(worlds):
        folder = out / f"nothing_{seed}_{world}"
        if (folder / "labels.json").exists():
            continue
        folder.mkdir(parents=True, exist_ok=True)
        random = np.random.default_rng((seed, world))
        labels: dict[str, list[list[float]]] = {}
        for number in range(PER_WORLD):
            part, name = _hard_part(random, pictures, network), f"{number:04d}.jpg"
            setting = [cv2.IMWRITE_JPEG_QUALITY, int(random.integers(*_QUALITY))]
            cv2.imwrite(str(folder / name), part.picture, setting)
            labels[name] = part.rows
        sources = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}
        (folder / "sources.json").write_text(json.dumps(sources))
        whole = {"classes": CLASSES, "pictures": labels}
        (folder / "labels.json").write_text(json.dumps(whole))


def _hard_part(random: np.random.Generator, pictures: Sequence[Canvas], network: Network) -> Part:
    cut = [cut_part(random, pictures[random.integers(len(pictures))]) for _ in range(_CANDIDATES)]
    for number in np.nonzero(random.random(_CANDIDATES) < _GRAY)[0]:
        gray = cv2.cvtColor(cut[number], cv2.COLOR_BGR2GRAY)
        cut[number] = np.asarray(cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR), np.uint8)
    return max((judge(network, each) for each in cut), key=lambda part: part.hardness)


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path, help="folder to write to")
    parser.add_argument("sources", type=Path, nargs="+", help="pictures, films, folders of them")
    parser.add_argument("--worlds", type=int, default=20, help="how many (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--start", type=Path, required=True, help="network that is trained on")
    asked = parser.parse_args()
    files = files_in(asked.sources)
    write_worlds(asked.out, files, asked.worlds, asked.seed, asked.start)
    return 0


if __name__ == "__main__":
    run(main)

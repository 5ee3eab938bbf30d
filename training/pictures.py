"""Pictures with known landmarks, rendered by the simulator.

    python training/pictures.py OUT --worlds 100

Each world gets a folder ``OUT/world_<seed>_<number>`` with JPEG files and ``labels.json``: the
classes, and for each file a list of [class, x0, y0, x1, y1, point u, point v, share seen].
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from degrade import degrade
from grounds import Canvas
from shots import Seen, take_shot
from worlds import CLASSES, build_world

SIZE = 320, 320
PER_WORLD = 160
_QUALITY = 40, 96  # of JPEG
_LEAST_CONTRAST = 8.0
_RIM, _LETTER = 0.15, -0.2  # of the sides: around what stands out, and to where a pad's letter is
_FLATTEST = 6.0
_NARROWEST_PAD = 20.0  # pixels; the strokes of a narrower one's letter are thinner than one


def render_world(
    seed: tuple[int, ...],
    count: int = PER_WORLD,
    size: tuple[int, int] = SIZE,
    held_out: bool = False,
    own: Sequence[Path] = (),
) -> Iterator[tuple[Canvas, list[Seen], tuple[str, ...]]]:
    """Pictures of one world: RGB, what is seen in it, and the names of the classes.

    Raises:
        OpenError: there is no OpenGL to render with; the message says what to install.
    """
    from ros_visualise.simulation.rendering import Renderer

    random = np.random.default_rng(seed)
    world = build_world(random, held_out, own)
    world.model.vis.global_.offwidth, world.model.vis.global_.offheight = size
    renderer = Renderer(world.model, size)
    try:
        for _ in range(count):
            view, seen = take_shot(world, random, size)
            half = size[1] / 2 / view.focal
            world.model.cam_fovy[0] = 2 * np.degrees(np.arctan(half))
            picture = renderer.render(world.data, view.position_xyz, view.R_map_camera)
            yield degrade(random, picture), seen, world.classes
    finally:
        renderer.close()


def write_world(
    folder: Path,
    seed: tuple[int, ...],
    count: int = PER_WORLD,
    size: tuple[int, int] = SIZE,
    held_out: bool = False,
    own: Sequence[Path] = (),
) -> None:
    """Write one world's pictures; the labels come last, so a folder with labels is whole."""
    folder.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng((*seed, 1))
    labels: dict[str, list[list[float]]] = {}
    classes: tuple[str, ...] = ()
    for picture, seen, names in render_world(seed, count, size, held_out, own):
        classes, file = names, f"{len(labels):04d}.jpg"
        setting = [cv2.IMWRITE_JPEG_QUALITY, int(random.integers(*_QUALITY))]
        cv2.imwrite(str(folder / file), picture[..., ::-1], setting)
        labels[file] = [row(one, picture) for one in seen]
    written = json.dumps({"classes": classes, "pictures": labels})
    (folder / "labels.json").write_text(written)


def row(seen: Seen, picture: Canvas) -> list[float]:
    """One line of ``labels.json``; nothing is seen of what nobody could tell."""
    hidden = is_flat(seen) or is_narrow(seen) or contrast(seen, picture) <= _LEAST_CONTRAST
    share = 0.0 if hidden else seen.share
    numbers: npt.NDArray[np.float64] = np.concatenate([seen.box, seen.point, [share]])
    return [seen.kind, *(round(float(each), 3) for each in numbers)]


def is_flat(seen: Seen) -> bool:
    """Whether what is drawn on a plane is seen almost from the side."""
    sides = np.sort(seen.box[2:] - seen.box[:2])
    drawn = seen.kind in (CLASSES.index("helipad"), CLASSES.index("tag"))
    return bool(drawn and sides[1] > _FLATTEST * sides[0])


def is_narrow(seen: Seen) -> bool:
    """Whether nobody could tell a pad's letter from others, and so a pad from a sign."""
    is_pad = seen.kind == CLASSES.index("helipad")
    return bool(is_pad and (seen.box[2:] - seen.box[:2]).min() < _NARROWEST_PAD)


def contrast(seen: Seen, picture: Canvas) -> float:
    """Standard deviation of the gray levels, smoothed, in and around a landmark's box.

    Of a pad it is that of the box's middle, where the letter is.
    """
    share = _LETTER if seen.kind == CLASSES.index("helipad") else _RIM
    rim = share * (seen.box[2:] - seen.box[:2]) + 1
    low = np.maximum(np.floor(seen.box[:2] - rim), 0).astype(int)
    high = np.ceil(seen.box[2:] + rim).astype(int) + 1
    part = cv2.cvtColor(picture[low[1] : high[1], low[0] : high[0]], cv2.COLOR_RGB2GRAY)
    return float(cv2.blur(part, (3, 3)).std())


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What pictures and training both take."""
    parser.add_argument("--seed", type=int, default=0, help="of the worlds")
    parser.add_argument(
        "--body",
        type=Path,
        action="append",
        default=[],
        metavar="FILE.xml",
        help="a MJCF file whose first body becomes a class more; may be given again",
    )


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path, help="folder to write to")
    parser.add_argument("--worlds", type=int, default=10, help="how many (default: %(default)s)")
    parser.add_argument("--first", type=int, default=0, help="number of the first")
    parser.add_argument("--per-world", type=int, default=PER_WORLD, help="pictures of each")
    parser.add_argument("--side", type=int, default=SIZE[0], help="pixels (default: %(default)s)")
    parser.add_argument("--held-out", action="store_true", help="styles never trained on")
    add_arguments(parser)
    asked = parser.parse_args()
    for number in range(asked.first, asked.first + asked.worlds):
        folder = asked.out / f"world_{asked.seed}_{number}"
        if not (folder / "labels.json").exists():
            size = asked.side, asked.side
            seed = asked.seed, number
            write_world(folder, seed, asked.per_world, size, asked.held_out, asked.body)
    return 0


if __name__ == "__main__":
    sys.exit(main())

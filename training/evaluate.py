"""Measure a network on held-out worlds and on real pictures.

    python training/pictures.py HELD --held-out --seed 1000 --side 640
    python training/evaluate.py aerial.onnx HELD --photos helipads/ --nothing video.avi

Runs the file as the node ``landmark_detector`` does, by onnxruntime alone.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import advice  # noqa: F401
import cv2
import numpy as np
import numpy.typing as npt
from metrics import Found, average_precision, gather, match, recall_at
from running import run

from ros_visualise.core.errors import OpenError
from ros_visualise.landmarks.networks.candidates import Candidates, SelectionRules
from ros_visualise.landmarks.networks.network import Network
from ros_visualise.landmarks.networks.tiles import tiles_of

Array = npt.NDArray[np.float64]
Names = Mapping[int, str]
_LEAST_PX, _LEAST_SHARE = 12.0, 0.5
_SIZES = ((12, 24), (24, 48), (48, 96), (96, 192), (192, 1000))
_SURE = 0.3
"""Least score where sizes and points are counted."""
_WHOLE = 0.97
_INSIDE = 5.99 / 2
"""Half the 95% limit of a chi-square with two degrees of freedom: squares here are means of two."""
_SCORES = 0.3, 0.4, 0.5, 0.6, 0.7, 0.8
"""Values of ``min_score`` in the tables."""
_ALLOWED = 0.01  # false detections of a class per picture
_CROP = 640  # side of the parts of larger pictures
_PICTURE_ENDS = (".jpg", ".jpeg", ".png")


class Case(NamedTuple):
    """A picture with its truth: rows as in ``labels.json``, (n, 8)."""

    picture: npt.NDArray[np.uint8]
    rows: Array


class Result(NamedTuple):
    """The true rows of a picture, and what was found in it, however doubtful."""

    rows: Array
    found: Candidates


def detect_all(network: Network, cases: Iterator[Case]) -> list[Result]:
    """Run the network on all pictures."""
    doubtful = SelectionRules(min_score=0.02)
    return [Result(each.rows, network.detect(each.picture, "BGR", doubtful)) for each in cases]


def world_cases(folder: Path) -> Iterator[Case]:
    """All pictures that `pictures.py` wrote to a folder."""
    for path in sorted(folder.glob("*/labels.json")):
        for name, rows in json.loads(path.read_text())["pictures"].items():
            yield Case(_read(path.parent / name), np.array(rows, np.float64).reshape(-1, 8))


def photo_cases(folder: Path) -> Iterator[Case]:
    """Photos of helipads with YOLO's text files: class, centre and size as shares."""
    for path in sorted(folder.glob("*.txt")):
        picture = _read(path.with_suffix(".jpg"))
        size = np.array([picture.shape[1], picture.shape[0]], np.float64)
        rows = np.loadtxt(path, ndmin=2)
        low, high = (rows[:, 1:3] + sign * rows[:, 3:5] / 2 for sign in (-1, 1))
        boxes = np.hstack([low * size, high * size]) - 0.5
        rest = np.tile([np.nan, np.nan, 1.0], (len(rows), 1))
        yield Case(picture, np.hstack([np.zeros((len(rows), 1)), boxes, rest]))


def coco_cases(path: Path, kind: int) -> Iterator[Case]:
    """Pictures beside a COCO file, all of whose boxes are of one class."""
    labels = json.loads(path.read_text())
    for image in labels["images"]:
        boxes = [a["bbox"] for a in labels["annotations"] if a["image_id"] == image["id"]]
        x, y, w, h = np.array(boxes, np.float64).T
        nothing, one = np.full_like(x, np.nan), np.ones_like(x)
        rows = np.stack([kind * one, x, y, x + w, y + h, nothing, nothing, one], axis=1)
        yield Case(_read(path.parent / Path(image["file_name"]).name), rows)


def frames(path: Path, step: int) -> Iterator[npt.NDArray[np.uint8]]:
    """Every n-th frame of a video, or all pictures of a folder; large ones in parts."""
    if path.is_dir() or _is_picture(path):
        for each in sorted(path.iterdir()) if path.is_dir() else [path]:
            if _is_picture(each):
                yield from _parts(_read(each))
        return
    video, number = cv2.VideoCapture(str(path)), 0
    while video.grab():
        if number % step == 0:
            yield np.asarray(video.retrieve()[1], np.uint8)
        number += 1


def _parts(picture: npt.NDArray[np.uint8]) -> Iterator[npt.NDArray[np.uint8]]:
    """A picture, or its tiles, if it is more than twice as large as the network's input."""
    height, width = picture.shape[:2]
    side = _CROP if max(height, width) > 2 * _CROP else max(height, width)
    for left, top, right, bottom in tiles_of((width, height), side):
        yield picture[top:bottom, left:right]


def report(names: Names, results: list[Result], title: str) -> None:
    """Print the table of one set of pictures."""
    present = sorted({int(kind) for each in results for kind in each.rows[:, 0]})
    kinds = [kind for kind in present if kind in names]
    print(f"\n{title}: {len(results)} pictures\n")
    if lacking := [kind for kind in present if kind not in names]:
        print(f"Objects of classes that this network lacks do not count: {lacking}\n")
    columns = ["class", "true", "AP50", "recall at precision 0.95", "its least score"]
    columns += [f"recall at {score}" for score in _SCORES] + ["true, unfiltered", "AP50"]
    _print_row(columns)
    _print_row(["---"] * len(columns))
    pairs = []
    for kind in kinds:
        matches = gather([_of_kind(each, kind) for each in results])
        every = gather([_of_kind(each, kind, filtered=False) for each in results])
        recall, score = recall_at(matches, 0.95)
        pairs.append((average_precision(matches), average_precision(every)))
        right = matches.scores[matches.right]
        recalls = [f"{(right >= each).sum() / matches.truths:.3f}" for each in _SCORES]
        row = [names[kind], matches.truths, f"{pairs[-1][0]:.3f}", f"{recall:.3f}", f"{score:.2f}"]
        _print_row([*row, *recalls, every.truths, f"{pairs[-1][1]:.3f}"])
    if len(pairs) > 1:
        usual, unfiltered = np.nanmean(pairs, axis=0)
        blank = [""] * (3 + len(_SCORES))
        _print_row(["mean of them", "", f"{usual:.3f}", *blank, f"{unfiltered:.3f}"])


def _print_row(cells: Sequence[object]) -> None:
    print("| " + " | ".join(str(each) for each in cells) + " |")


def report_sizes(results: list[Result]) -> None:
    """Print the recall of all classes by the longer side of the boxes."""
    there, hits = np.zeros(len(_SIZES), int), np.zeros(len(_SIZES), int)
    for result in results:
        for kind in np.unique(result.rows[:, 0]):
            found, truth, ignored = _of_kind(result, int(kind), _SURE)
            got = set(match(found, truth, ignored))
            side = (truth[:, 2:] - truth[:, :2]).max(axis=1)
            for bin_, (low, high) in enumerate(_SIZES):
                fits = np.nonzero(~ignored & (side >= low) & (side < high))[0]
                there[bin_] += len(fits)
                hits[bin_] += sum(int(number) in got for number in fits)
    print(f"\n| longer side, px | true | found at score {_SURE} |\n|---|---|---|")
    for (low, high), all_, hit in zip(_SIZES, there, hits, strict=True):
        print(f"| {low} to {high} | {all_} | {hit / max(all_, 1):.3f} |")


def report_points(names: Names, results: list[Result]) -> None:
    """Print how far ground points are from the truth, and whether their variances say so."""
    print("\n| class | points | median, % of the longer side | squared error / variance |")
    print("|---|---|---|---|")
    for kind, name in names.items():
        pairs = [pair for each in results for pair in _points_of(each, kind)]
        if pairs:
            shares, squares = np.array(pairs).T
            inside = np.mean(squares < _INSIDE)
            print(
                f"| {name} | {len(pairs)} | {100 * np.median(shares):.2f} "
                f"| {np.mean(squares):.2f} (median {np.median(squares):.2f}), "
                f"{inside:.0%} inside 95% |"
            )


def _points_of(result: Result, kind: int) -> Iterator[tuple[float, float]]:
    """Error by the box's longer side, and mean squared error by variance, of what is all seen."""
    mine = result.found.take((result.found.classes == kind) & (result.found.scores >= _SURE))
    if mine.points_uv is None or mine.covariances is None:
        return
    found, truth, ignored = _of_kind(result, kind, _SURE)
    rows = result.rows[result.rows[:, 0] == kind]
    for number, at in enumerate(match(found, truth, ignored)):
        if at >= 0 and rows[at, 7] > _WHOLE:
            gap = mine.points_uv[number] - rows[at, 5:7]
            side = (truth[at, 2:] - truth[at, :2]).max()
            square = gap @ np.linalg.inv(mine.covariances[number]) @ gap / 2
            yield float(np.linalg.norm(gap) / side), float(square)


def report_false(network: Network, paths: Sequence[Path], step: int) -> None:
    """Print the false detections per 100 pictures without landmarks, by class and ``min_score``.

    Vehicles are right where the pictures show some.
    """
    columns = ["pictures", "number", "class", *_SCORES, f"score for {_ALLOWED:.0%}"]
    _print_row(columns)
    _print_row(["---"] * len(columns))
    for path in paths:
        count, scores = 0, {number: list[float]() for number in network.names}
        for picture in frames(path, step):
            found = network.detect(picture, "BGR", SelectionRules(min_score=_SCORES[0]))
            for kind, score in zip(found.classes, found.scores, strict=True):
                scores[int(kind)].append(float(score))
            count += 1
        for number, name in network.names.items():
            some = np.array(scores[number])
            shares = [f"{100 * (some >= each).sum() / count:.1f}" for each in _SCORES]
            least = least_score(some, count)
            _print_row([path.name, count, name, *shares, f"{least:.2f}"])


def least_score(scores: Array, pictures: int) -> float:
    """The lowest ``min_score``, in hundredths, with no more false detections than are allowed."""
    grid = np.arange(30, 101) / 100
    false = (scores[:, None] >= grid).sum(axis=0)
    return float(grid[false <= _ALLOWED * pictures][0])


def _of_kind(
    result: Result, kind: int, least: float = 0.0, filtered: bool = True
) -> tuple[Found, Array, npt.NDArray[np.bool_]]:
    """Arguments for `match`, for one class.

    Args:
        filtered: what nobody could recognise does not count; otherwise it has to be found, too.
    """
    mine = result.found.take((result.found.classes == kind) & (result.found.scores >= least))
    rows = result.rows[result.rows[:, 0] == kind]
    side = (rows[:, 3:5] - rows[:, 1:3]).max(axis=1) if len(rows) else np.zeros(0)
    share = rows[:, 7] if filtered else np.abs(rows[:, 7])
    ignored = (side < _LEAST_PX) | (share < _LEAST_SHARE)
    return Found(mine.boxes_xyxy, mine.scores), rows[:, 1:5], ignored


def _read(path: Path) -> npt.NDArray[np.uint8]:
    picture = cv2.imread(str(path))
    if picture is None:
        raise OpenError(f"{path}: no picture")
    return np.asarray(picture, np.uint8)


def _is_picture(path: Path) -> bool:
    return path.suffix.lower() in _PICTURE_ENDS


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("onnx", type=Path)
    parser.add_argument("worlds", type=Path, nargs="*", help="folders that pictures.py wrote")
    parser.add_argument("--photos", type=Path, help="folder of helipads with YOLO's boxes")
    parser.add_argument("--cars", type=Path, help="COCO file of vehicles")
    parser.add_argument("--nothing", type=Path, nargs="*", default=[], help="without landmarks")
    parser.add_argument("--step", type=int, default=20, help="between frames of a video")
    asked = parser.parse_args()
    network = Network(str(asked.onnx))
    names = network.names
    for folder in asked.worlds:
        results = detect_all(network, world_cases(folder))
        report(names, results, f"Worlds in {folder.name}")
        report_sizes(results)
        report_points(names, results)
    if asked.photos:
        report(names, detect_all(network, photo_cases(asked.photos)), "Photos of helipads")
    if asked.cars:
        kind = next(number for number, name in names.items() if name == "vehicle")
        report(names, detect_all(network, coco_cases(asked.cars, kind)), "Photos of cars")
    if asked.nothing:
        report_false(network, asked.nothing, asked.step)
    return 0


if __name__ == "__main__":
    run(main)

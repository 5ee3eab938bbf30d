"""ROS 1 bags: one, or the parts of one that was split."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from ros_visualise.sources.recordings import Loss, Recording
from ros_visualise.sources.recordings.merging import MergedRecording, open_storages
from ros_visualise.sources.recordings.rosbag1.bag_file import BagFile

_PART = re.compile(r"(.*?)(?:\d{4}(?:-\d\d){5})?_(\d+)\.bag(?:\.active)?")


def open_rosbag1(path: Path) -> Recording:
    """Open a ROS 1 bag, or the folder of one that was split; raises OpenError."""
    loss = Loss()
    files = _parts(path, loss) if path.is_dir() else [path]
    with ExitStack() as stack:
        bags = open_storages(path, files, BagFile, loss, stack)
        release = stack.pop_all().close
    is_indexed = all(bag.is_indexed for bag in bags)
    format = "rosbag 2.0" if is_indexed else "rosbag 2.0, unindexed"
    return MergedRecording(path, format, bags, loss, release)


def is_split_bag(files: Sequence[Path]) -> bool:
    """True if they are the parts of one, as ``rosbag record --split`` names them.

    That is ``NAME_0.bag``, ``NAME_1.bag``, ...; the name may end with when each part was begun.
    """
    parts = [_PART.fullmatch(file.name) for file in files]
    names = {part[1] for part in parts if part}
    numbers = {int(part[2]) for part in parts if part}
    return len(names) == 1 and len(numbers) == len(files) > 1


def _parts(folder: Path, loss: Loss) -> list[Path]:
    """The parts in a folder in their order; a missing one between them is a loss.

    ``rosbag record --max-splits`` deletes the first ones.
    """
    numbers = {
        int(part[2]): file for file in folder.iterdir() if (part := _PART.fullmatch(file.name))
    }
    first, last = min(numbers), max(numbers)
    if last - first < 2 * len(numbers):  # else they count something else, such as days
        for number in sorted({*range(first, last)} - numbers.keys()):
            loss.add(f"its part {number} is missing")
    return [numbers[number] for number in sorted(numbers)]

"""ROS 1 bags, also split ones."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ros_visualise.sources.formats import Format
from ros_visualise.sources.recordings import Recording


def _open(path: Path) -> Recording:
    from ros_visualise.sources.recordings.rosbag1 import open_rosbag1

    return open_rosbag1(path)


def _is_split(files: Sequence[Path]) -> bool:
    from ros_visualise.sources.recordings.rosbag1 import is_split_bag

    return len(files) > 1 and is_split_bag(files)


FORMAT = Format(
    "ROS 1 bag",
    _open,
    suffixes=(".bag",),
    begins=lambda head: head.startswith(b"#ROSBAG V"),
    is_series=_is_split,
)

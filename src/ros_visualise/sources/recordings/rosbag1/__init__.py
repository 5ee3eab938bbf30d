"""ROS 1 bags: one, or those into which a recording was split."""

from __future__ import annotations

from pathlib import Path

from ros_visualise.sources.recordings import Loss, Recording
from ros_visualise.sources.recordings.merging import MergedRecording
from ros_visualise.sources.recordings.rosbag1.bag_file import BagFile
from ros_visualise.sources.recordings.schemas import Schemas


def open_rosbag1(path: Path) -> Recording:
    """Open a ROS 1 bag.

    Raises:
        OpenError: nothing of it can be read; the message says what to do.
    """
    loss = Loss()
    bag = BagFile(path, Schemas(), loss)
    format = "rosbag 2.0" if bag.is_indexed else "rosbag 2.0, unindexed"
    return MergedRecording(path, format, [bag], loss)

"""ROS 1 bags, also split ones."""

from __future__ import annotations

from ros_visualise.sources.formats import Format, lazily

FORMAT = Format(
    "ROS 1 bag",
    lazily("recordings.rosbag1:open_rosbag1"),
    suffixes=(".bag",),
    begins=lambda head: head.startswith(b"#ROSBAG V"),
    is_series=lazily("recordings.rosbag1:is_split_bag"),
)

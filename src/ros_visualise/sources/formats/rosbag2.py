"""ROS 2 bags: folders, single SQLite files, and files of a folder without metadata."""

from __future__ import annotations

from ros_visualise.sources.formats import Format, lazily
from ros_visualise.sources.recordings.metadata import METADATA

FORMAT = Format(
    "ROS 2 bag's SQLite file",
    lazily("recordings.rosbag2:open_whole"),
    suffixes=(".db3",),
    begins=lambda head: head.startswith(b"SQLite format 3\0"),
    is_folder=lambda folder: (folder / METADATA).is_file(),
    is_series=lazily("recordings.rosbag2:are_parts"),
)

"""Drives of the KITTI data set, raw or of the odometry benchmark."""

from __future__ import annotations

from ros_visualise.sources.formats import Format, lazily

FORMAT = Format(
    "KITTI drive",
    lazily("kitti:open_kitti"),
    is_folder=lazily("kitti:is_whole"),
    is_within=lazily("kitti:is_kitti"),
    whole_of=lazily("kitti:find_whole"),
)

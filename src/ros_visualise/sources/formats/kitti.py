"""Drives of the KITTI data set, raw or of the odometry benchmark."""

from __future__ import annotations

from pathlib import Path

from ros_visualise.sources.formats import Format
from ros_visualise.sources.recordings import Recording


def _open(path: Path) -> Recording:
    from ros_visualise.sources.kitti import open_kitti

    return open_kitti(path)


def _is_kitti(folder: Path) -> bool:
    from ros_visualise.sources.kitti import is_kitti

    return is_kitti(folder)


def _whole_of(folder: Path) -> Path | None:
    from ros_visualise.sources.kitti import find_whole

    return find_whole(folder)


FORMAT = Format("KITTI drive", _open, is_within=_is_kitti, whole_of=_whole_of)

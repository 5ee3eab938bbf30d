"""KITTI's folders as recordings of ROS topics.

- the raw drives, synced and rectified or neither: `ros_visualise.sources.kitti.raw`
- the sequences of the odometry benchmark: `ros_visualise.sources.kitti.odometry`

Topics are ``/cam00/image_rect`` (of unsynced drives ``image_raw``) and ``/cam00/camera_info`` to
``/cam03``, ``/velodyne_points``, ``/velodyne_points/scan_start`` and ``/velodyne_points/scan_end``
(when a turn of the scanner began and ended, stamped as its cloud), ``/imu/data``, ``/gps/fix``,
``/gps/vel``, ``/odom``, ``/path`` (the whole way, at the start), ``/tf`` and ``/tf_static``.

Frames are map -> odom -> base_link -> imu_link -> velodyne, and ``cam00_optical`` to
``cam03_optical`` in velodyne.

Stamps are the times in KITTI's files, to the nanosecond, as if they were UTC: as other tools have
them. In truth they are local summer time of Karlsruhe, two hours ahead of UTC. KITTI does not say
so, but shadows do: in drive 0052 of 2011-09-26 the car heads south at 14:19, and the sun stands 10
to 20 degrees west of that, as it does there at 12:19 UTC; at 14:19 UTC it would be 53 degrees.
"""

from __future__ import annotations

from pathlib import Path

from ros_visualise.sources.kitti.files import (
    find_folder,
    find_folders,
    find_whole,
    is_sequence,
    is_whole,
)
from ros_visualise.sources.kitti.odometry import open_sequence
from ros_visualise.sources.kitti.raw import open_drive
from ros_visualise.sources.recordings.series import SeriesRecording

__all__ = ["find_whole", "is_kitti", "is_whole", "open_kitti"]


def is_kitti(path: str | Path) -> bool:
    """True if it is a folder of KITTI's, or one above some."""
    return bool(find_folders(Path(path)))


def open_kitti(path: str | Path) -> SeriesRecording:
    """A drive, a sequence, or a folder above that holds just one; raises OpenError."""
    folder = find_folder(Path(path))
    return open_sequence(folder) if is_sequence(folder) else open_drive(folder)

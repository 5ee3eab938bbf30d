"""KITTI's calibration files: the cameras' pictures, and where each sensor is on the car.

The optical frames here are those of the *rectified* cameras, of synced and of unsynced drives
alike: each at its own camera's centre, all turned as rectified camera 0 is. ROS means this frame
where it uses ``P`` of a CameraInfo, so that

- ``P`` takes a point of ``camNN_optical`` to its pixel in the rectified image; its last column is
  0, as the baseline is the distance between the frames and must not be counted twice;
- of an unsynced image, ``R`` turns the raw camera's axes to those of this frame, and image_geometry
  or ``cv2.projectPoints`` (with R transposed, K, D) give the pixel in the raw image.

Source: A. Geiger et al., Vision meets Robotics: The KITTI Dataset, IJRR 2013, section 4, and the
development kit's readme.txt: ``x = P_rect_i R_rect_00 Tr_velo_to_cam X``.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ros_visualise.data import CameraInfo, Floats
from ros_visualise.geometry import transforms

Matrices = dict[str, Floats]
"""Name in a file -> its numbers, in a row."""


@dataclass(frozen=True, eq=False)
class Camera:
    """One camera: its calibration, and T_velodyne_camera, 4x4; None where they are not known."""

    info: CameraInfo | None = None
    T_velodyne_camera: Floats | None = None


def read_matrices(path: Path) -> Matrices:
    """The lines ``NAME: NUMBERS`` of a file; of one that is absent, none.

    Lines that hold anything else, such as dates, are left out.
    """
    try:
        lines = path.read_text("utf-8", "replace").splitlines()
    except OSError:
        return {}
    found = {}
    for line in lines:
        name, _, values = line.partition(":")
        try:
            numbers = np.array([float(value) for value in values.split()])
        except ValueError:
            continue
        if len(numbers) and np.isfinite(numbers).all():
            found[name.strip()] = numbers
    return found


def rigid(matrices: Matrices) -> Floats | None:
    """The 4x4 transform of ``R`` and ``T``, or None."""
    R, T = matrices.get("R"), matrices.get("T")
    if R is None or T is None or len(R) != 9 or len(T) != 3:
        return None
    return transforms.from_parts(R.reshape(3, 3), T)


def rigid_3x4(numbers: Floats | None) -> Floats | None:
    """The 4x4 transform of 12 numbers, or None."""
    if numbers is None or len(numbers) != 12:
        return None
    rows = numbers.reshape(3, 4)
    return transforms.from_parts(rows[:, :3], rows[:, 3])


def raw_camera(
    number: int, cam_to_cam: Matrices, T_cam0_velodyne: Floats | None, rectified: bool
) -> Camera:
    """A camera of a raw drive, from ``calib_cam_to_cam.txt`` and ``calib_velo_to_cam.txt``."""
    of = f"{number:02d}"
    row, R_rect_00 = cam_to_cam.get(f"P_rect_{of}"), cam_to_cam.get("R_rect_00")
    if row is None or len(row) != 12:
        return Camera()
    P = row.reshape(3, 4)
    info = _rectified(P, cam_to_cam, of) if rectified else _raw(P, cam_to_cam, of)
    if T_cam0_velodyne is None or R_rect_00 is None or len(R_rect_00) != 9:
        return Camera(info)
    T_rect0_cam0 = transforms.from_parts(R_rect_00.reshape(3, 3), np.zeros(3))
    return Camera(info, _place(P, T_rect0_cam0 @ T_cam0_velodyne))


def sequence_camera(
    number: int, calib: Matrices, width: int, height: int, T_rect0_base: Floats
) -> Camera:
    """A camera of the odometry benchmark, from ``calib.txt``; images there are rectified.

    Its place is that in whatever frame camera 0 is known in.
    """
    row = calib.get(f"P{number}")
    if row is None or len(row) != 12:
        return Camera()
    P = row.reshape(3, 4)
    return Camera(_pinhole(P, width, height), _place(P, T_rect0_base))


def offset(P: Floats) -> Floats:
    """Where rectified camera 0 is in the frame of the camera of ``P``, (3,) metres."""
    return np.asarray(np.linalg.solve(P[:, :3], P[:, 3]), np.float64)


def _place(P: Floats, T_rect0_base: Floats) -> Floats:
    T_camera_rect0 = transforms.from_parts(np.eye(3), offset(P))
    return transforms.inverse(T_camera_rect0 @ T_rect0_base)


def _rectified(P: Floats, cam_to_cam: Matrices, of: str) -> CameraInfo | None:
    size = cam_to_cam.get(f"S_rect_{of}")
    return None if size is None or len(size) != 2 else _pinhole(P, int(size[0]), int(size[1]))


def _pinhole(P: Floats, width: int, height: int) -> CameraInfo:
    return CameraInfo(height, width, K=P[:, :3].copy(), D=np.zeros(5), P=_own(P))


def _raw(P: Floats, cam_to_cam: Matrices, of: str) -> CameraInfo | None:
    size, K, D, R = (cam_to_cam.get(f"{name}_{of}") for name in ("S", "K", "D", "R_rect"))
    if size is None or K is None or D is None or R is None:
        return None
    if (len(size), len(K), len(D), len(R)) != (2, 9, 5, 9):
        return None
    return CameraInfo(
        int(size[1]), int(size[0]), K=K.reshape(3, 3), D=D, R=R.reshape(3, 3), P=_own(P)
    )


def _own(P: Floats) -> Floats:
    """``P`` for points in the camera's own frame."""
    return np.column_stack([P[:, :3], np.zeros(3)])

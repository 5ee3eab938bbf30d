"""KITTI's calibration files: the cameras' pictures, and where each sensor is on the car.

The optical frames here are those of the *rectified* cameras, of synced and of unsynced drives
alike: each at its own camera's centre, all with the axes of rectified camera 0. ROS means this
frame where it uses ``P`` of a CameraInfo, so that

- ``P`` projects a point in ``camNN_optical`` to its pixel in the rectified image. Its last column
  is 0: in KITTI's file it is the camera's offset from camera 0, for points in the frame of camera
  0, while in ROS it is for points in the message's frame. With both, rviz and image_geometry would
  count the baseline twice. It is the distance between the frames in ``/tf_static``;
- of an unsynced image, ``R`` turns the raw camera's axes to those of this frame, and image_geometry
  or ``cv2.projectPoints`` (with R transposed, K, D) give the pixel in the raw image.

Source: A. Geiger et al., Vision meets Robotics: The KITTI Dataset, IJRR 2013, section 4, and the
development kit's readme.txt: ``x = P_rect_i R_rect_00 Tr_velo_to_cam X``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ros_visualise.data import CameraInfo, Floats
from ros_visualise.geometry import se3
from ros_visualise.sources.kitti.files import Findings, read_lines
from ros_visualise.sources.kitti.sensors import optical_frame
from ros_visualise.sources.series import DamagedFile

Matrices = dict[str, Floats]
"""Name in a file -> its numbers, in a row; empty if damaged."""

_COUNTS = {"P": 12, "Tr": 12, "K": 9, "R": 9, "D": 5, "T": 3, "S": 2}
"""First letters of a row's name -> count of its numbers."""
_TURN_ERROR = 0.01  # of files with few digits
_LARGEST = 2**16  # side of an image


@dataclass(frozen=True, eq=False)
class KittiCamera:
    """One camera: its calibration, and T_velodyne_camera, 4x4; None where they are unknown."""

    info: CameraInfo | None = None
    T_velodyne_camera: Floats | None = None


class CalibrationFile:
    """The rows of a file, and what is skipped because it is damaged.

    Args:
        path: the file; None: it is missing, which is no damage.

    Attributes:
        rows: the readable rows, and empty arrays for the others.
    """

    def __init__(self, path: Path | None) -> None:
        self._path, self._why = path, ""
        self._lacking: dict[str, None] = {}
        self._skipped: dict[str, None] = {}
        self._messages = 0
        self.rows: Matrices = {}
        try:
            self.rows = {} if path is None else read_matrices(path)
        except DamagedFile as error:
            self._why = error.why

    @property
    def exists(self) -> bool:
        """True if there is such a file."""
        return self._path is not None

    def has(self, names: Sequence[str], needed_for: Sequence[str], messages: int = 0) -> bool:
        """True if these rows are whole; if not, `report` names what is skipped.

        Args:
            names: names of the rows.
            needed_for: topics and frames that are skipped without them.
            messages: number of messages that are then skipped.
        """
        lacking = [name for name in names if not len(self.rows.get(name, ()))]
        if lacking:
            self._lacking |= dict.fromkeys(lacking)
            self._skipped |= dict.fromkeys(needed_for)
            self._messages += messages
        return not lacking

    def report(self, findings: Findings) -> None:
        """Note the damage, if the file lacks anything that was asked for."""
        if self._path is None or not self._lacking:
            return
        first, more = next(iter(self._lacking)), len(self._lacking) - 1
        which = f"{first} and {more} more are" if more else f"{first} is"
        why = self._why or f"{which} missing or damaged"
        error = DamagedFile(self._path, f"{why}; skipped: {', '.join(self._skipped)}")
        findings.lose(error, self._messages)


def read_matrices(path: Path) -> Matrices:
    """The lines ``NAME: NUMBERS`` of a file; raises DamagedFile if it is unreadable."""
    pairs = [line.partition(":")[::2] for line in read_lines(path) if line.strip()]
    return {name.strip(): _numbers(name.strip(), values) for name, values in pairs}


def is_rotation(R: Floats) -> bool:
    """True if a matrix (3, 3) is a pure rotation."""
    return bool(np.abs(R @ R.T - np.eye(3)).max() < _TURN_ERROR and np.linalg.det(R) > 0)


def rigid(file: CalibrationFile, needed_for: Sequence[str]) -> Floats | None:
    """The 4x4 transform of ``R`` and ``T``, or None; for ``needed_for``: see `CalibrationFile`."""
    if not file.has(("R", "T"), needed_for):
        return None
    return se3.from_parts(file.rows["R"].reshape(3, 3), file.rows["T"])


def rigid_3x4(numbers: Floats) -> Floats:
    """The 4x4 transform of 12 numbers."""
    rows = numbers.reshape(3, 4)
    return se3.from_parts(rows[:, :3], rows[:, 3])


def raw_camera(
    number: int,
    cam_to_cam: CalibrationFile,
    T_cam0_velodyne: Floats | None,
    rectified: bool,
    images: int,
) -> KittiCamera:
    """A camera of a raw drive, from ``calib_cam_to_cam.txt`` and ``calib_velo_to_cam.txt``."""
    of, rows = f"{number:02d}", cam_to_cam.rows
    names = ("P_rect", "S_rect") if rectified else ("P_rect", "S", "K", "D", "R_rect")
    info = T = None
    if cam_to_cam.has([f"{name}_{of}" for name in names], [f"/cam{of}/camera_info"], images):
        P = rows[f"P_rect_{of}"].reshape(3, 4)
        info = _pinhole(P, *rows[f"S_rect_{of}"]) if rectified else _raw(P, rows, of)
    is_placed = cam_to_cam.has((f"P_rect_{of}", "R_rect_00"), [optical_frame(number)])
    if is_placed and T_cam0_velodyne is not None:
        T_rect0_cam0 = se3.from_parts(rows["R_rect_00"].reshape(3, 3), np.zeros(3))
        T = _place(rows[f"P_rect_{of}"].reshape(3, 4), T_rect0_cam0 @ T_cam0_velodyne)
    return KittiCamera(info, T)


def sequence_camera(
    number: int, calib: CalibrationFile, size: tuple[int, int], T_rect0_base: Floats, images: int
) -> KittiCamera:
    """A camera of the odometry benchmark, from ``calib.txt``; images there are rectified.

    Its pose is relative to the base frame of ``T_rect0_base``.
    """
    needing = [f"/cam{number:02d}/camera_info", optical_frame(number)]
    if not calib.has((f"P{number}",), needing, images):
        return KittiCamera()
    P = calib.rows[f"P{number}"].reshape(3, 4)
    return KittiCamera(_pinhole(P, *size), _place(P, T_rect0_base))


def _place(P: Floats, T_rect0_base: Floats) -> Floats:
    """T_base_camera, 4x4, of the camera of ``P``; rectified cameras share their axes."""
    T_camera_rect0 = se3.from_parts(np.eye(3), np.linalg.solve(P[:, :3], P[:, 3]))
    return se3.inverse(T_camera_rect0 @ T_rect0_base)


def _numbers(name: str, values: str) -> Floats:
    """The numbers of a row; empty if they are implausible."""
    none = np.zeros(0)
    try:
        row = np.array([float(value) for value in values.split()])
    except ValueError:
        return none
    kind = re.split(r"[_\d]", name)[0]
    is_whole = len(row) == _COUNTS.get(kind, len(row)) and np.isfinite(row).all()
    return row if is_whole and _is_likely(kind, row) else none


def _is_likely(kind: str, row: Floats) -> bool:
    """True if a row can be a rotation, a camera's matrix, a size."""
    if kind == "R":
        return is_rotation(row.reshape(3, 3))
    if kind == "Tr":
        return is_rotation(row.reshape(3, 4)[:, :3])
    if kind in ("P", "K"):
        matrix = row.reshape(3, -1)
        is_upright = matrix[0, 0] > 0 and matrix[1, 1] > 0 and matrix[2, 2] == 1
        return bool(is_upright and np.linalg.det(matrix[:, :3]) > 0)
    return kind != "S" or bool(((row >= 1) & (row < _LARGEST)).all())


def _pinhole(P: Floats, width: float, height: float) -> CameraInfo:
    return CameraInfo(int(height), int(width), K=P[:, :3].copy(), D=np.zeros(5), P=_own(P))


def _raw(P: Floats, rows: Matrices, of: str) -> CameraInfo:
    size, K, D, R = (rows[f"{name}_{of}"] for name in ("S", "K", "D", "R_rect"))
    width, height = map(int, size)
    return CameraInfo(height, width, K=K.reshape(3, 3), D=D, R=R.reshape(3, 3), P=_own(P))


def _own(P: Floats) -> Floats:
    """``P`` for points in the camera's own frame."""
    return np.column_stack([P[:, :3], np.zeros(3)])

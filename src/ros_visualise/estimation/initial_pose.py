"""A pose of the robot that the user states, such as by RViz's button "2D Pose Estimate".

That button states x, y and yaw; height, roll and pitch are 0 with variance 0, which means unknown.
For these, the odometry counts, whose frame is level; for other unknown parts, `_SIGMAS`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ros_visualise.core.errors import ParameterError
from ros_visualise.data import Floats, PoseWithCovarianceStamped
from ros_visualise.estimation.odometry import OdometryNoise, place_robot
from ros_visualise.estimation.state import State
from ros_visualise.geometry import rigid, rotations
from ros_visualise.geometry.se3 import about_origin

_SIGMAS = np.array([0.5, 0.5, 2.0, 0.0, 0.0, math.radians(15)])
"""Standard deviations (6,) where none is stated, m and rad; roll and pitch: that of the odometry's
frame.
"""
_LARGEST = 1e6  # m
_VAGUEST = np.repeat([1e6, math.pi**2], 3)  # variances, m^2 and rad^2; larger ones count as these


class InitialPose(NamedTuple):
    """A pose in the map.

    Attributes:
        position_xyz, R: (3,) and (3, 3).
        covariance: (6, 6) of the position and of rotations about the robot; 0 where unknown.
    """

    position_xyz: Floats
    R: Floats
    covariance: Floats

    @property
    def is_height_known(self) -> bool:
        """False if its height is that of RViz's button."""
        return bool(self.position_xyz[2] or self.covariance[2, 2])

    def placed(
        self, state: State, odometry: rigid.Pose, level_rad: float, noise: OdometryNoise
    ) -> State:
        """A state with the robot there.

        Args:
            odometry: the robot in the odometry's frame at that time.
            level_rad: standard deviation of the tilt of the odometry's frame.
        """
        T, p, R = rigid.to_matrix(odometry), self.position_xyz.copy(), self.R
        covariance, unknown = self.covariance.copy(), np.diag(self.covariance) <= 0
        if not self.is_height_known:
            p[2] = T[2, 3]
        if unknown[3:5].any():
            unknown[3:5] = True
            R = _about_z(_yaw(R) - _yaw(T[:3, :3])) @ T[:3, :3]
        covariance[unknown], covariance[:, unknown] = 0, 0
        sigmas = _SIGMAS.copy()
        sigmas[3:5] = level_rad
        covariance[unknown, unknown] = sigmas[unknown] ** 2
        change, new = about_origin(p), state.copy()
        place_robot(new, R, p, change @ covariance @ change.T, noise)
        return new


def pose_of_message(message: PoseWithCovarianceStamped, frame_id: str) -> InitialPose | str:
    """The pose of a message in the map's frame, or why it is invalid."""
    given, covariance = message.header.frame_id.lstrip("/"), message.covariance
    if given not in ("", frame_id):
        return f"it is in the frame {given}; give it in {frame_id} (in RViz: Fixed Frame)"
    numbers = (message.position_xyz, message.quat_xyzw, covariance)
    if not all(np.isfinite(one).all() for one in numbers):
        return "it contains NaN or infinite numbers"
    if np.abs(message.position_xyz).max() > _LARGEST:
        return f"its position is beyond {_LARGEST:g} m"
    if not 0.9 < np.linalg.norm(message.quat_xyzw) < 1.1:
        return "its orientation is not a unit quaternion"
    even = covariance / 2 + covariance.T / 2
    values = np.linalg.eigvalsh(even)
    if not np.allclose(covariance, even) or values[0] < -1e-9 * max(values[-1], 1e-9):
        return "its covariance is not symmetric and positive semidefinite"
    within = np.sqrt(_VAGUEST / np.maximum(np.diag(even), _VAGUEST))
    even = within[:, None] * even * within
    return InitialPose(message.position_xyz, rotations.to_matrix(message.quat_xyzw), even)


def pose_of_text(text: str, sigma_m: float, yaw_sigma_rad: float) -> InitialPose | None:
    """The pose "x, y, z, yaw", m and degrees; None for an empty text.

    Raises:
        ParameterError: it is invalid.
    """
    if not text.strip():
        return None
    try:
        x, y, z, yaw_deg = map(float, text.split(","))
        p = np.array([x, y, z])
        if not np.isfinite([*p, yaw_deg]).all() or np.abs(p).max() > _LARGEST:
            raise ValueError
    except ValueError:
        raise ParameterError(
            f"start={text}: give x, y, z in metres and yaw in degrees: 2.0, 1.5, 0.0, 90"
        ) from None
    covariance = np.diag([sigma_m, sigma_m, sigma_m, 0, 0, yaw_sigma_rad]) ** 2
    return InitialPose(p, _about_z(math.radians(yaw_deg)), covariance)


def _yaw(R: Floats) -> float:
    return math.atan2(R[1, 0], R[0, 0])


def _about_z(angle: float) -> Floats:
    return rotations.to_matrix(rotations.from_rpy([0, 0, angle]))

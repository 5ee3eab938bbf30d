"""Error of the camera pose given by tf, and how long the same error lasts.

Ten views with one attitude error are not ten independent measurements of a landmark. So the robot's
error is a state that all landmarks share; it is considered, but never estimated from them (a
Schmidt-Kalman filter). Its six numbers are the translation of the camera and its rotation about
itself, relative to tf, along and about the axes of the fixed frame.

Source: S. F. Schmidt, Application of state-space methods to navigation problems, Advances in
Control Systems 3, 1966.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.steadiness import loosened
from ros_visualise.geometry.se3 import about_itself

_DRIFT = 0.005  # metres per metre, of an odometry that began before it was listened to
_LEAST = 1e-12  # variance, m^2 or rad^2, of odometry that reports zero


@dataclass(frozen=True)
class ErrorModel:
    """Slowly changing errors, as first-order Gauss-Markov processes.

    Standard deviations in metres and radians; after ``position_s`` and ``attitude_s`` seconds, 37 %
    of an error is left.
    """

    position_m: float = 0.05
    attitude_rad: float = math.radians(1)
    position_s: float = 60.0
    attitude_s: float = 60.0

    def at_level(self, level: float) -> ErrorModel:
        """The same for a camera less steady than stated, see `estimation.steadiness`."""
        attitude_rad, attitude_s = loosened(self.attitude_rad, self.attitude_s, level)
        return replace(self, attitude_rad=attitude_rad, attitude_s=attitude_s)


class RobotError:
    """The robot's error from image to image, with its present `covariance` (6, 6)."""

    def __init__(self) -> None:
        self.covariance = np.zeros((6, 6))
        self._deviations = np.zeros(6)
        self._stamp_ns: int | None = None
        self._camera = np.zeros(3)
        self._way_m = 0.0
        self._is_given = False

    def advance(
        self, stamp_ns: int, camera_xyz: Floats, model: ErrorModel, given: Floats | None
    ) -> Floats:
        """Propagate to the time of an image.

        Args:
            stamp_ns: time of the image.
            camera_xyz: (3,) position of the camera in the fixed frame.
            model: used if no covariance is given.
            given: (6, 6) covariance of the present error, as reported by an odometry.

        Returns:
            (6, 6) how much of each previous error is in each present one.
        """
        elapsed_s = 0.0 if self._stamp_ns is None else abs(stamp_ns - self._stamp_ns) / 1e9
        before, was_given = self.covariance, self._is_given
        self._stamp_ns, self._is_given = stamp_ns, given is not None
        shift, self._camera = camera_xyz - self._camera, camera_xyz
        if given is not None:
            self.covariance = given + _LEAST * np.eye(6)
            if not was_given:
                self._way_m = 0.0
                return np.zeros((6, 6))
            self._way_m += float(np.linalg.norm(shift))
            return _walked(before, self.covariance, shift, self._way_m)
        deviations = np.repeat([model.position_m, model.attitude_rad], 3)
        self.covariance = np.diag(deviations**2)
        held_s = np.repeat([model.position_s, model.attitude_s], 3)
        scale = np.divide(deviations, self._deviations, out=np.zeros(6), where=self._deviations > 0)
        self._deviations = deviations
        return np.diag(np.zeros(6) if was_given else scale * np.exp(-elapsed_s / held_s))


def at_camera(covariance: Floats, R_fixed_odom: Floats, base_to_camera_xyz: Floats) -> Floats:
    """An odometry's covariance (6, 6), in its frame and about the robot, as one of the camera.

    Args:
        base_to_camera_xyz: (3,) from the robot to its camera, in the fixed frame.
    """
    carried = about_itself(base_to_camera_xyz) @ np.kron(np.eye(2), R_fixed_odom)
    moved: Floats = carried @ covariance @ carried.T
    return moved


def _walked(before: Floats, now: Floats, shift: Floats, way_m: float) -> Floats:
    """The remaining part of errors that accumulated along the way.

    The covariance has grown over the whole way, so at least the share of the last step is new, also
    where it does not grow: on the way back a constant scale error shrinks, while a random walk goes
    on. Propagated rigidly, the old error is entirely part of the new one where the covariance grew.
    Where it shrank, something corrected it, and the new error is what remains of the old, as after
    a Kalman update: cov(new, old) = cov(new).
    """
    carry = about_itself(shift)
    root = np.linalg.cholesky(carry @ before @ carry.T)
    back = np.linalg.inv(root)
    ratios, axes = np.linalg.eigh(back @ now @ back.T)
    way_m = max(way_m, math.sqrt(np.trace(now[:3, :3]) / 3) / _DRIFT, 1e-9)
    old = 1 - min(float(np.linalg.norm(shift)) / way_m, 1.0)
    kept: Floats = root @ (axes * np.minimum(ratios, 1)) @ axes.T @ back @ carry
    return math.sqrt(old) * kept

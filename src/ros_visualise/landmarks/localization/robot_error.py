"""How wrong the frames may be about the camera, and for how long the same error lasts.

Ten views with one attitude error are not ten votes on where a landmark is. So the robot's error is
a state that all landmarks share; it is considered, and never estimated from them (a Schmidt-Kalman
filter). Its six numbers are by how much the camera is elsewhere, and is turned about itself, than
the frames tell, along and about the axes of the fixed frame.

Source: S. F. Schmidt, Application of state-space methods to navigation problems, Advances in
Control Systems 3, 1966.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.localization.seen import cross

_LEAST = 1e-12  # variance, m^2 or rad^2, of an odometry that says it has no error


@dataclass(frozen=True)
class ErrorModel:
    """Steady errors that are forgotten after some time, as first-order Gauss-Markov processes.

    Standard deviations in metres and radians; after ``position_s`` and ``attitude_s`` seconds the
    errors are 37 % of what they were.
    """

    position_m: float = 0.05
    attitude_rad: float = math.radians(1)
    position_s: float = 60.0
    attitude_s: float = 60.0


class RobotError:
    """The robot's error from image to image; `covariance` is (6, 6), by now."""

    def __init__(self) -> None:
        self.covariance = np.zeros((6, 6))
        self._deviations = np.zeros(6)
        self._stamp_ns: int | None = None
        self._camera = np.zeros(3)
        self._is_given = False

    def advance(
        self, stamp_ns: int, camera_xyz: Floats, model: ErrorModel, given: Floats | None
    ) -> Floats:
        """Go on to the time of an image.

        Args:
            stamp_ns: when it was taken.
            camera_xyz: (3,) where, in the fixed frame.
            model: the errors, where nothing is given.
            given: (6, 6) covariance of the error now, as an odometry tells it.

        Returns:
            (6, 6) how much of each error of before is in each error of now.
        """
        elapsed_s = 0.0 if self._stamp_ns is None else abs(stamp_ns - self._stamp_ns) / 1e9
        before, was_given = self.covariance, self._is_given
        self._stamp_ns, self._is_given = stamp_ns, given is not None
        shift, self._camera = cross(camera_xyz - self._camera), camera_xyz
        if given is not None:
            self.covariance = given + _LEAST * np.eye(6)
            return _walked(before, self.covariance, shift) if was_given else np.zeros((6, 6))
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
    carried = _moved(-cross(base_to_camera_xyz)) @ np.kron(np.eye(2), R_fixed_odom)
    moved: Floats = carried @ covariance @ carried.T
    return moved


def _moved(lever: Floats) -> Floats:
    """(6, 6) errors about one point from those about another: turns move what is off the point."""
    move = np.eye(6)
    move[:3, 3:] = lever
    return move


def _walked(before: Floats, now: Floats, shift: Floats) -> Floats:
    """What is left of errors that were added up along the way.

    Carried along rigidly, the old error is wholly in the new one where the covariance grew; where
    it shrank, something corrected it, and what is left is the new error, as after a Kalman update:
    cov(new, old) = cov(new).
    """
    carry = _moved(-shift)
    root = np.linalg.cholesky(carry @ before @ carry.T)
    back = np.linalg.inv(root)
    ratios, axes = np.linalg.eigh(back @ now @ back.T)
    kept: Floats = root @ (axes * np.minimum(ratios, 1)) @ axes.T @ back @ carry
    return kept

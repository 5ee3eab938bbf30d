"""Where a message says that something is."""

from __future__ import annotations

import math

import numpy as np

from ros_visualise.data import (
    Floats,
    NavSatFix,
    Odometry,
    PoseStamped,
    PoseWithCovarianceStamped,
    TransformStamped,
)
from ros_visualise.geometry.geodesy import LocalPlane

Located = Odometry | PoseStamped | PoseWithCovarianceStamped | TransformStamped | NavSatFix

PLANE_FRAME = "map"
"""The frame of positions on the local plane: x east, y north, z up (REP 103, REP 105)."""

_FARTHEST_M = 1e12  # where numbers of 64 bits still tell tenths of millimetres apart


class Locator:
    """Takes poses from messages; fixes are projected on the local plane of the first one.

    A fix has no attitude, so it gets that of the plane. If its altitude is not a number, the last
    one is used.

    Attributes:
        refused: number of messages with a position that is not finite, or impossibly far.
        without_fix: number of fixes whose status is "no fix".
    """

    def __init__(self) -> None:
        self.refused = self.without_fix = 0
        self.reset()

    def reset(self) -> None:
        """Begin anew: the next fix is the first one."""
        self._plane: LocalPlane | None = None
        self._altitude_m = 0.0

    def locate(self, message: Located) -> Floats | None:
        """Position and quaternion (7,): x, y, z in metres and x, y, z, w; None where it says none.

        A fix's are in `PLANE_FRAME`, all others' in the frame of the header.
        """
        if isinstance(message, NavSatFix) and message.status < 0:
            self.without_fix += 1
            return None
        found = self._read(message)
        if not (np.isfinite(found).all() and np.abs(found).max() < _FARTHEST_M):
            self.refused += 1
            return None
        return found

    def _read(self, message: Located) -> Floats:
        if isinstance(message, NavSatFix):
            return np.array([*self._on_plane(message), 0.0, 0.0, 0.0, 1.0])
        if isinstance(message, TransformStamped):
            return np.concatenate([message.translation_xyz, message.quat_xyzw])
        return np.concatenate([message.position_xyz, message.quat_xyzw])

    def _on_plane(self, fix: NavSatFix) -> Floats:
        place = np.array([fix.latitude, fix.longitude])
        if not (np.isfinite(place).all() and abs(place[0]) <= 90 and abs(place[1]) <= 360):
            return np.full(3, math.nan)
        if math.isfinite(fix.altitude):
            self._altitude_m = fix.altitude
        if self._plane is None:
            self._plane = LocalPlane(place[0], place[1], self._altitude_m)
        return self._plane.to_enu([*place, self._altitude_m])

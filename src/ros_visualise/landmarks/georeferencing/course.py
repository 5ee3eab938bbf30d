"""The pose of a camera without attitude: at its fixes, level, and looking along their course."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from ros_visualise.data import Floats, NavSatFix
from ros_visualise.geometry import rotations
from ros_visualise.geometry.aircraft import R_body_camera
from ros_visualise.landmarks.georeferencing.origin import MapOrigin

TILT_RAD, HEADING_RAD = math.radians(5), math.radians(30)
"""Standard deviations of what is assumed: cameras sway, and drones also fly sideways."""
_LEAST_M, _KEPT_NS = 3.0, 10_000_000_000  # of a way that shows the course
_FAR_NS = 5_000_000_000  # between an image and the fix before it
_UNKNOWN_M = 1e4


class Course:
    """Follows fixes, which come in order.

    Attributes:
        origin: at the first fix, of unknown height above the ground; None: no fix yet.
    """

    def __init__(self) -> None:
        self.origin: MapOrigin | None = None
        self._fixes: deque[NavSatFix] = deque()
        self._heading: float | None = None

    def take(self, fix: NavSatFix) -> None:
        """Add a fix; those without a position or a new stamp change nothing."""
        stamp_ns = fix.header.stamp_ns
        place = np.array([fix.latitude, fix.longitude, fix.altitude])
        is_late = bool(self._fixes) and stamp_ns <= self._fixes[-1].header.stamp_ns
        if fix.status < 0 or not np.isfinite(place).all() or is_late:
            return
        if self.origin is None:
            self.origin = MapOrigin(place, np.diag([0.0, 0.0, _UNKNOWN_M**2]))
        self._fixes.append(fix)
        while stamp_ns - self._fixes[0].header.stamp_ns > _KEPT_NS:
            self._fixes.popleft()
        ways = self._enu(self.origin)[-1] - self._enu(self.origin)
        far = np.flatnonzero(np.linalg.norm(ways[:, :2], axis=1) >= _LEAST_M)
        if len(far):
            east, north, _ = ways[far[-1]]
            self._heading = math.atan2(north, east)

    def pose(self, origin: MapOrigin, stamp_ns: int, pitch_deg: float) -> Floats | None:
        """T_map_camera, 4x4, of a camera so far below the horizon; None without course or fix."""
        if self._heading is None or abs(stamp_ns - self._fixes[-1].header.stamp_ns) > _FAR_NS:
            return None
        enu = self._enu(origin)
        T = np.eye(4)
        T[:3, :3] = rotations.to_matrix(rotations.from_rpy([0, 0, self._heading]))
        T[:3, :3] = T[:3, :3] @ R_body_camera(pitch_deg)
        T[:3, 3] = enu[-1]
        if len(enu) > 1:
            before, last = (one.header.stamp_ns for one in (self._fixes[-2], self._fixes[-1]))
            T[:3, 3] += (enu[-1] - enu[-2]) * (stamp_ns - last) / (last - before)
        return T

    def _enu(self, origin: MapOrigin) -> Floats:
        """(N, 3) places in the map."""
        places = [(f.latitude, f.longitude, f.altitude) for f in self._fixes]
        return origin.plane.to_enu(places)

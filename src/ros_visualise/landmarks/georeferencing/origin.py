"""The place on the Earth of a map's origin."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from ros_visualise.core.errors import NoTransform
from ros_visualise.data import Floats, Header, NavSatFix
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.geometry.geodesy import LocalPlane

MAP = "map"
BODY, GIMBAL = "base_link", "gimbal"
"""A robot's body; fixes are taken to be of its place where the antenna's frame is unknown."""
_ODOM = "odom"
_DIAGONAL = 2  # of what is known of the covariance
_NO_GROUND_M2 = 1e6


@dataclass(frozen=True, eq=False)
class MapOrigin:
    """The place of the origin of a frame with x east, y north, z up.

    Attributes:
        place: (3,) latitude and longitude in degrees, altitude in metres.
        covariance_m2: (3, 3) east, north, up; zero: unknown.
    """

    place: Floats
    covariance_m2: Floats

    @classmethod
    def of(cls, message: NavSatFix) -> MapOrigin:
        """The origin that a source publishes."""
        place = np.array([message.latitude, message.longitude, message.altitude])
        return cls(place, message.covariance)

    @property
    def has_ground(self) -> bool:
        """True if z is 0 on the ground there, as at a point of take-off."""
        return bool(self.covariance_m2[2, 2] < _NO_GROUND_M2)

    @property
    def plane(self) -> LocalPlane:
        """Converts positions in the map."""
        return LocalPlane(*self.place)

    def message(self, stamp_ns: int, frame: str) -> NavSatFix:
        """The origin as a message."""
        latitude, longitude, altitude = self.place.tolist()
        kind = _DIAGONAL if self.covariance_m2.any() else 0
        header = Header(stamp_ns, frame)
        return NavSatFix(latitude, longitude, altitude, self.covariance_m2, kind, header=header)


def map_frame(wanted: str, frames: FrameTree) -> str:
    """The frame with x east, y north, z up: ``odom`` where ``map`` is wanted and missing."""
    return _ODOM if wanted == MAP and MAP not in frames.frames() else wanted


class OriginFinder:
    """The origin that a source gives, else an estimate by fixes and where they are in the map.

    Errors of fixes last for minutes: their mean is not taken to be better than a single one, and
    worse if they disagree with the map, as where it is turned away from north.
    """

    def __init__(self) -> None:
        self.given: MapOrigin | None = None
        self._first: LocalPlane | None = None
        self._count = 0
        self._mean, self._squares = np.zeros(3), np.zeros(3)
        self._variance = np.zeros(3)

    def take(
        self,
        fix: NavSatFix,
        fixed: str,
        bodies: Sequence[str],
        frames: FrameTree,
        sigmas_m: Floats,
    ) -> bool:
        """Add a fix, unless it has no position; False if none of the frames ``bodies`` is known."""
        if fix.status < 0 or self.given is not None:
            return True
        for frame in (fix.header.frame_id, *bodies):
            with suppress(NoTransform):
                T_fixed_antenna = frames.lookup(fixed, frame, fix.header.stamp_ns)
                self.add(fix, T_fixed_antenna[:3, 3], sigmas_m)
                return True
        return False

    def add(self, fix: NavSatFix, position_xyz: Floats, sigmas_m: Floats) -> None:
        """Add a fix.

        Args:
            fix: with a position.
            position_xyz: (3,) in the map at its time.
            sigmas_m: (3,) standard deviations of a fix without a covariance.
        """
        place = np.array([fix.latitude, fix.longitude, fix.altitude])
        if self._first is None:
            self._first = LocalPlane(*place)
        off = self._first.to_enu(place) - position_xyz
        self._count += 1
        before = off - self._mean
        self._mean = self._mean + before / self._count
        self._squares = self._squares + before * (off - self._mean)
        own = np.diag(fix.covariance) if fix.covariance.any() else sigmas_m**2
        self._variance = self._variance + (own - self._variance) / self._count

    @property
    def origin(self) -> MapOrigin | None:
        """The given one, else the estimate; None without fixes."""
        if self.given is not None:
            return self.given
        if self._first is None:
            return None
        variance = np.maximum(self._variance, self._squares / self._count)
        variance[2] = min(variance[2], _NO_GROUND_M2 / 2)
        return MapOrigin(self._first.from_enu(self._mean), np.diag(variance))

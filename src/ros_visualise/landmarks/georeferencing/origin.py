"""The place on the Earth of a map's origin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ros_visualise.data import Floats, Header, NavSatFix
from ros_visualise.geometry.geodesy import LocalPlane

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


class OriginFinder:
    """Estimates an origin by fixes and the positions in the map at their times.

    Errors of fixes last for minutes: their mean is not taken to be better than a single one, and
    worse if they disagree with the map, as where it is turned away from north.
    """

    def __init__(self) -> None:
        self._first: LocalPlane | None = None
        self._count = 0
        self._mean, self._squares = np.zeros(3), np.zeros(3)
        self._variance = np.zeros(3)

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
        """The estimate; None without fixes."""
        if self._first is None:
            return None
        variance = np.maximum(self._variance, self._squares / self._count)
        variance[2] = min(variance[2], _NO_GROUND_M2 / 2)
        return MapOrigin(self._first.from_enu(self._mean), np.diag(variance))

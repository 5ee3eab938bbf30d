"""Positions on the Earth: the WGS 84 ellipsoid, planes that touch it, and KITTI's Mercator map.

``geodetic`` are arrays (..., 3) of latitude and longitude in degrees and metres above the
ellipsoid; ``ecef`` (..., 3) metres, fixed to the Earth, origin in its centre; ``enu`` (..., 3)
metres to the east, to the north and up.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

_A = 6378137.0  # equatorial radius, m; NGA.STND.0036 (2014), table 3.1, as the flattening below
_F = 1 / 298.257223563
_B = _A * (1 - _F)
_E2 = _F * (2 - _F)


def to_ecef(geodetic: npt.ArrayLike) -> Floats:
    """Positions (..., 3) in ECEF.

    Source: NGA.STND.0036 (2014), World Geodetic System 1984, equation 4-14.
    """
    lat, lon, altitude = _radians(geodetic)
    radius = _A / np.sqrt(1 - _E2 * np.sin(lat) ** 2)
    across = (radius + altitude) * np.cos(lat)
    z = (radius * (1 - _E2) + altitude) * np.sin(lat)
    return np.stack([across * np.cos(lon), across * np.sin(lon), z], axis=-1)


def from_ecef(ecef: npt.ArrayLike) -> Floats:
    """Geodetic positions (..., 3); exact to a nanometre from the ground to the orbits of GPS.

    Source: B. R. Bowring, Transformation from Spatial to Geographical Coordinates, Survey Review
    23 (1976), repeated; altitude: B. R. Bowring, The Accuracy of Geodetic Latitude and Height
    Equations, Survey Review 28 (1985).
    """
    x, y, z = np.moveaxis(np.asarray(ecef, np.float64), -1, 0)
    across = np.hypot(x, y)
    reduced = np.arctan2(z * _A, across * _B)
    for _ in range(4):
        lat = np.arctan2(
            z + _E2 / (1 - _E2) * _B * np.sin(reduced) ** 3,
            across - _E2 * _A * np.cos(reduced) ** 3,
        )
        reduced = np.arctan2(_B * np.sin(lat), _A * np.cos(lat))
    altitude = across * np.cos(lat) + z * np.sin(lat) - _A * np.sqrt(1 - _E2 * np.sin(lat) ** 2)
    return np.stack([np.degrees(lat), np.degrees(np.arctan2(y, x)), altitude], axis=-1)


class LocalPlane:
    """The plane that is level at a datum: east, north, up.

    Args:
        latitude, longitude: of the origin, degrees.
        altitude: of the origin, metres above the ellipsoid.
    """

    def __init__(self, latitude: float, longitude: float, altitude: float = 0.0) -> None:
        self._origin = to_ecef([latitude, longitude, altitude])
        self._R_enu_ecef = _enu_axes(latitude, longitude)

    def to_enu(self, geodetic: npt.ArrayLike) -> Floats:
        """Positions (..., 3) in the plane: metres east, north and up of the datum."""
        offset = to_ecef(geodetic) - self._origin
        enu: Floats = offset @ self._R_enu_ecef.T
        return enu

    def from_enu(self, enu: npt.ArrayLike) -> Floats:
        """Geodetic positions (..., 3)."""
        return from_ecef(np.asarray(enu, np.float64) @ self._R_enu_ecef + self._origin)

    def rotation_at(self, latitude: float, longitude: float) -> Floats:
        """R_plane_local (3, 3): from east, north and up of another place."""
        turned: Floats = self._R_enu_ecef @ _enu_axes(latitude, longitude).T
        return turned


def kitti_mercator(geodetic: npt.ArrayLike, first_latitude: float) -> Floats:
    """Positions (..., 3) in metres as KITTI's own tools compute them from its OXTS packets.

    A Mercator map of a sphere, scaled to be true at one latitude: far from there, and in
    absolute size, it differs from `LocalPlane`.

    Args:
        geodetic: (..., 3).
        first_latitude: of the first packet, degrees.

    Source: A. Geiger et al., Vision meets Robotics: The KITTI Dataset, IJRR 2013, and its
    development kit's latlonToMercator.
    """
    lat, lon, altitude = _radians(geodetic)
    radius = np.cos(np.radians(first_latitude)) * _A
    y = radius * np.log(np.tan(np.pi / 4 + lat / 2))
    return np.stack([radius * lon, y, altitude], axis=-1)


def _enu_axes(latitude: float, longitude: float) -> Floats:
    """R_enu_ecef (3, 3)."""
    lat, lon = np.radians([latitude, longitude])
    return np.array(
        [
            [-np.sin(lon), np.cos(lon), 0],
            [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)],
            [np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)],
        ]
    )


def _radians(geodetic: npt.ArrayLike) -> tuple[Floats, Floats, Floats]:
    values = np.asarray(geodetic, np.float64)
    return np.radians(values[..., 0]), np.radians(values[..., 1]), values[..., 2]

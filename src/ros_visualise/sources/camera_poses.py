"""Poses of cameras that know where they are on the Earth, as topics.

``fix`` is the camera's position, ``tf`` its optical frame in ``map``: x east, y north, z up at
``map_origin``, where z is 0 on the ground if its height is known. ``lens`` is a lens by its field
of view, which is no calibration.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ros_visualise.data import (
    CameraInfo,
    Floats,
    Header,
    NavSatFix,
    Transforms,
    TransformStamped,
)
from ros_visualise.geometry import rotations
from ros_visualise.geometry.aircraft import to_attitude
from ros_visualise.geometry.geodesy import LocalPlane
from ros_visualise.sources.series import Series, single

MAP, OPTICAL = "map", "camera_optical"
UNKNOWN_M = 1e4
"""Standard deviation of the ground's height at an origin whose z is 0 elsewhere."""

_STEP_NS, _GAP_NS = 200_000_000, 5_000_000_000
_Times = npt.NDArray[np.int64]
_FLU_OPTICAL = np.array([-0.5, 0.5, -0.5, 0.5])  # right, down, forward in forward, left, up
_NONE, _APPROXIMATED, _DIAGONAL = 0, 1, 2


@dataclass(frozen=True, eq=False)
class CameraPoses:
    """Positions and attitudes of a camera; what is unknown is NaN.

    Attributes:
        stamps_ns: (N,).
        places: (N, 3) latitude and longitude in degrees, and altitude in metres.
        quats: (N, 4) x, y, z, w of the optical frame, relative to east, north, up at its place.
        ground_m: altitude of the ground.
        ground_at: latitude and longitude of that ground; None: below the camera.
        sigmas_m: (N, 3) standard deviations of the places: east, north, up.
    """

    stamps_ns: npt.NDArray[np.int64]
    places: Floats
    quats: Floats
    ground_m: float = np.nan
    ground_at: tuple[float, float] | None = None
    sigmas_m: Floats | None = None

    @property
    def is_placed(self) -> npt.NDArray[np.bool_]:
        """(N,) True with a position."""
        latitudes, longitudes = np.abs(self.places[:, :2].T)
        return np.asarray((latitudes <= 90) & (longitudes <= 180), bool)  # NaN is not


def above_ground(altitudes: Floats, heights: Floats) -> tuple[Floats, float]:
    """Altitudes (N,), by the heights above take-off (N,) where they are known, and the ground's.

    What is unknown is NaN; where no altitude is known, the ground's is 0.
    """
    ground = altitudes - heights if np.isfinite(altitudes).any() else 0 * heights
    known = ground[np.isfinite(ground)]
    ground_m = float(known[0]) if len(known) else np.nan
    return np.where(np.isfinite(heights), ground_m + heights, altitudes), ground_m


def angle_quats(yaw_pitch_roll_deg: npt.ArrayLike) -> Floats:
    """(N, 4) of forward, right, down in north, east, down, of angles (N, 3) in degrees: yaw from
    north to east, pitch upwards, roll to the right.
    """
    angles = np.asarray(yaw_pitch_roll_deg, np.float64).reshape(-1, 3)
    return rotations.from_rpy(np.radians(angles[:, ::-1]))


def optical_quats(quats_ned: Floats) -> Floats:
    """(N, 4) of optical frames in east, north, up, of `angle_quats` of cameras."""
    x, y, z, w = quats_ned.T
    known = np.isfinite(x + y + z + w)
    turned = to_attitude(np.where(known, [w, x, y, z], [[1], [0], [0], [0]]).T)
    return np.where(known[:, None], rotations.multiply(turned, _FLU_OPTICAL), np.nan)


def camera_series(poses: CameraPoses, frame: str = OPTICAL, is_track: bool = True) -> list[Series]:
    """The topics ``fix``, ``tf`` and ``map_origin``, as far as they are known.

    Between the poses of a track others are interpolated: images wait only shortly for ``tf``.
    """
    placed = np.flatnonzero(poses.is_placed)
    if not len(placed):
        return []
    several = [Series("fix", NavSatFix, poses.stamps_ns[placed], _fixes(poses, placed, frame))]
    posed = placed[
        np.isfinite(poses.quats[placed]).all(axis=1) & np.isfinite(poses.places[placed, 2])
    ]
    is_known = bool(np.isfinite(poses.ground_m))
    if not len(posed) and not (is_known and is_track):
        return several
    latitude, longitude, altitude = poses.places[posed[0] if len(posed) else placed[0]].tolist()
    latitude, longitude = poses.ground_at or (latitude, longitude)
    base = poses.ground_m if is_known else altitude
    start_ns = int(poses.stamps_ns[placed].min())
    sigmas = np.array([0.0, 0.0, 0.0 if is_known else UNKNOWN_M])
    header = Header(start_ns, MAP)
    origin = NavSatFix(latitude, longitude, base, np.diag(sigmas**2), _DIAGONAL, header=header)
    several = [single("map_origin", origin, start_ns), *several]
    if len(posed):
        plane = LocalPlane(latitude, longitude, base)
        several.insert(1, _transforms(poses, posed, plane, frame, is_track))
    return several


def _transforms(
    poses: CameraPoses,
    posed: npt.NDArray[np.intp],
    plane: LocalPlane,
    frame: str,
    is_track: bool,
) -> Series:
    positions = plane.to_enu(poses.places[posed])
    turns = rotations.from_matrix([plane.rotation_at(*one[:2]) for one in poses.places[posed]])
    quats = rotations.multiply(turns, poses.quats[posed])
    stamps_ns = poses.stamps_ns[posed]
    if is_track:
        stamps_ns, positions, quats = _filled(stamps_ns, positions, quats)

    def transform(index: int) -> Transforms:
        header = Header(int(stamps_ns[index]), MAP)
        return Transforms((TransformStamped(frame, positions[index], quats[index], header),))

    return Series("tf", Transforms, stamps_ns, transform)


def _filled(stamps_ns: _Times, positions: Floats, quats: Floats) -> tuple[_Times, Floats, Floats]:
    """Poses with others between them, where there is no long gap; the last one holds for a step,
    as the last image is often a little later.
    """
    stamps_ns, order = np.unique(stamps_ns, return_index=True)
    stamps_ns, order = np.append(stamps_ns, stamps_ns[-1] + _STEP_NS), np.append(order, order[-1])
    positions, quats = positions[order], quats[order]
    gaps_ns = np.diff(stamps_ns)
    counts = np.where(gaps_ns <= _GAP_NS, -(-gaps_ns // _STEP_NS), 1)
    before = np.repeat(np.arange(len(counts)), counts)
    share = (np.arange(len(before)) - np.repeat(np.cumsum(counts) - counts, counts)) / (
        counts[before]
    )
    moved = positions[before] + share[:, None] * (positions[before + 1] - positions[before])
    turned = rotations.slerp(quats[before], quats[before + 1], share)
    filled_ns = stamps_ns[before] + np.round(share * gaps_ns[before]).astype(np.int64)
    return (
        np.append(filled_ns, stamps_ns[-1]),
        np.vstack([moved, positions[-1:]]),
        np.vstack([turned.reshape(-1, 4), quats[-1:]]),
    )


def lens_series(several: Iterable[tuple[int, CameraInfo]]) -> list[Series]:
    """The topic ``lens``: lenses with their times."""
    lenses = list(several)
    if not lenses:
        return []
    stamps_ns = np.array([stamp_ns for stamp_ns, _ in lenses], np.int64)

    def lens(index: int) -> CameraInfo:
        return replace(lenses[index][1], header=Header(int(stamps_ns[index]), OPTICAL))

    return [Series("lens", CameraInfo, stamps_ns, lens, latched=True)]


def _fixes(
    poses: CameraPoses, placed: npt.NDArray[np.intp], frame: str
) -> Callable[[int], NavSatFix]:
    def fix(number: int) -> NavSatFix:
        index = placed[number]
        latitude, longitude, altitude = poses.places[index].tolist()
        sigmas = np.full(3, np.nan) if poses.sigmas_m is None else poses.sigmas_m[index]
        is_known = bool(np.isfinite(sigmas).all())
        return NavSatFix(
            latitude,
            longitude,
            altitude,
            np.diag(np.square(sigmas)) if is_known else np.zeros((3, 3)),
            _APPROXIMATED if is_known else _NONE,
            header=Header(int(poses.stamps_ns[index]), frame),
        )

    return fix

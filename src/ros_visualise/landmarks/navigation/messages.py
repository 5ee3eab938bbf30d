"""Messages of the navigator: landmarks, markers and diagnostics."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ros_visualise.data import (
    Detection3D,
    Detections3D,
    DiagnosticArray,
    DiagnosticStatus,
    Floats,
    Header,
    Hypothesis,
    Level,
    Marker,
    MarkerArray,
)
from ros_visualise.data.markers import MarkerType
from ros_visualise.geometry import rotations
from ros_visualise.landmarks.localization.common_error import split
from ros_visualise.landmarks.localization.estimate import known
from ros_visualise.landmarks.localization.messages import ellipsoid
from ros_visualise.landmarks.localization.track import Branch, LandmarkTrack
from ros_visualise.landmarks.navigation.landmark import Landmark, message_covariance
from ros_visualise.landmarks.navigation.landmark_map import MapMode
from ros_visualise.landmarks.navigation.navigator import Navigator, RobotEstimate
from ros_visualise.landmarks.navigation.state import FilterState

_GREEN, _RED, _GRAY, _BLUE = (0.1, 0.8, 0.2), (0.95, 0.15, 0.1), (0.6, 0.6, 0.6), (0.2, 0.5, 1.0)
_PLATE_M, _TEXT_M = 0.02, 0.25
_SHOWN_NS = 1_000_000_000  # how long a landmark keeps the colour of its outcome


def landmarks_of(navigator: Navigator, header: Header) -> Detections3D:
    """The landmarks that correct the robot; an undecided one has both poses."""
    chart, state = navigator.landmark_map, navigator.state
    there = [
        _detection(one, state, navigator.common) for one in chart.landmarks.values() if one.is_used
    ]
    return Detections3D(tuple(there), header)


def tracks_of(
    navigator: Navigator, given: Mapping[str, LandmarkTrack]
) -> tuple[list[LandmarkTrack], Floats]:
    """The map as tracks, with the covariance (6, 6) that all landmarks share.

    Args:
        given: the previous map; landmarks that were not seen stay unchanged.
    """
    chart, state, common = navigator.landmark_map, navigator.state, navigator.common
    if navigator.settings.rules.mode is MapMode.FROZEN:
        return list(given.values()), common
    before = [one for name, one in given.items() if name not in chart.landmarks]
    found = [one for one in chart.landmarks.values() if one.is_used]
    if navigator.settings.rules.mode is MapMode.BUILD:
        common = _common(state, [one.key for one in found if one.has_orientation])
        return [_track(one, state, 0.0) for one in found], common
    return [*before, *(_track(one, state, common) for one in found)], common


def _common(state: FilterState, keys: list[str]) -> Floats:
    """(6, 6) common covariance of the tags in the state."""
    rows = np.array([np.arange(state.rows(key).start, state.rows(key).stop) for key in keys], int)
    rows = rows.ravel()
    return split(state.covariance[np.ix_(rows, rows)].reshape(len(keys), 6, len(keys), 6))[0]


def markers_of(navigator: Navigator, now: RobotEstimate, header: Header) -> MarkerArray:
    """The ellipsoids of robot and landmarks: green if used, red if rejected, with the reason."""
    axes_lengths, axes = ellipsoid(now.covariance[:3, :3])
    color = np.array([*(_BLUE if now.is_located else _RED), 0.4])
    place = now.T_map_base[:3, 3]
    drawn = [Marker(MarkerType.SPHERE, place, axes, axes_lengths, color, ns="robot", id=0)]
    for one in navigator.landmark_map.landmarks.values():
        drawn += _landmark(navigator, one, header.stamp_ns)
    return MarkerArray(tuple(replace(one, header=header) for one in drawn))


def diagnostics_of(
    navigator: Navigator, now: RobotEstimate | None, header: Header
) -> DiagnosticArray:
    """Diagnostics: localized or why not, the uncertainty, and the outcome of the last image."""
    outcome = navigator.outcome
    lost = not navigator.is_located
    said = navigator.reason or "localized"
    if not lost and outcome.rejected:
        said = f"rejects {', '.join(outcome.rejected)}"
    level = Level.ERROR if lost else Level.WARN if outcome.rejected else Level.OK
    sigmas = np.sqrt(np.diag(now.covariance)) if now else np.full(6, np.nan)
    values = {
        "mode": navigator.settings.rules.mode.value,
        "located": str(navigator.is_located),
        "position sigma (m)": f"{np.linalg.norm(sigmas[:3]):.3f}",
        "heading sigma (deg)": f"{np.degrees(sigmas[5]):.2f}",
        "candidate supported by": ", ".join(sorted(navigator.found_by)),
        "used": ", ".join(outcome.used),
        "pending": ", ".join(outcome.pending),
        "landmarks": str(sum(one.is_used for one in navigator.landmark_map.landmarks.values())),
        **{f"rejected {name}": why for name, why in outcome.rejected.items()},
        **{name: str(count) for name, count in navigator.counts.items()},
        "imu": _imu(navigator),
        "GPS fixes used": str(navigator.sensors.gps.used),
        "GPS fixes rejected": str(navigator.sensors.gps.rejected),
    }
    return DiagnosticArray((DiagnosticStatus("landmark_navigator", level, said, values),), header)


def _imu(navigator: Navigator) -> str:
    if navigator.sensors.is_imu_rejected:
        return "ignored: contradicts the odometry"
    return "used" if navigator.sensors.imu.has_data else "none"


def _pose(state: FilterState, key: str) -> tuple[Floats, Floats]:
    (place,) = state.indices([key])
    return state.landmarks_p[place], state.landmarks_R[place]


def _detection(one: Landmark, state: FilterState, common: Floats) -> Detection3D:
    hypotheses = []
    for key, weight in zip(one.keys, one.weights, strict=True):
        p, R = _pose(state, key)
        covariance = message_covariance(state, key, common)
        quat = rotations.from_matrix(R)
        hypotheses.append(Hypothesis(one.kind, weight, p, quat, covariance, one.number))
    first = hypotheses[0]
    return Detection3D(first.position_xyz, first.quat_xyzw, _size(one), tuple(hypotheses), one.name)


def _track(one: Landmark, state: FilterState, common: Floats | float) -> LandmarkTrack:
    p, R = _pose(state, one.key)
    branch = Branch(known(p, R, message_covariance(state, one.key, common)), 0.0)
    return LandmarkTrack(
        one.kind,
        one.number,
        one.has_orientation,
        (branch,),
        one.last_ns,
        number=0 if one.has_orientation else int(one.name.rpartition("_")[2]),
        size_xyz=_size(one),
        sizes=one.seen if one.side_m else 0,
        seen=one.seen,
    )


def _size(one: Landmark) -> Floats:
    return np.array([one.side_m, one.side_m, 0.0])


def _landmark(navigator: Navigator, one: Landmark, stamp_ns: int) -> list[Marker]:
    """A plate in the colour of its outcome, the ellipsoid, and the reason of a rejection."""
    state, why = navigator.state, navigator.outcome.rejected.get(one.name, "")
    p, R = _pose(state, one.key)
    is_fresh = one.name in navigator.outcome.used or stamp_ns - one.last_ns < _SHOWN_NS
    color = _RED if why else _GREEN if is_fresh and one.is_used else _GRAY
    number = zlib.crc32(one.name.encode()) & 0x7FFFFFFF
    lengths, axes = ellipsoid(message_covariance(state, one.key, navigator.common)[:3, :3])
    plate = np.array([one.side_m or _TEXT_M, one.side_m or _TEXT_M, _PLATE_M])
    quat, text = rotations.from_matrix(R), f"{one.name}: {why}" if why else one.name
    above = p + np.array([0, 0, plate[0] / 2 + _TEXT_M])
    return [
        Marker(MarkerType.CUBE, p, quat, plate, np.array([*color, 0.8]), ns="plate", id=number),
        Marker(MarkerType.SPHERE, p, axes, lengths, np.array([*color, 0.3]), ns="error", id=number),
        Marker(
            MarkerType.TEXT_VIEW_FACING,
            above,
            scale_xyz=np.full(3, _TEXT_M),
            color_rgba=np.array([*color, 1.0]),
            text=text,
            ns="label",
            id=number,
        ),
    ]

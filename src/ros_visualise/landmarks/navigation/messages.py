"""What the navigator tells, as messages: landmarks, what to draw, and how it is doing."""

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
from ros_visualise.landmarks.navigation.landmark import Landmark, told_covariance
from ros_visualise.landmarks.navigation.landmark_map import MapMode
from ros_visualise.landmarks.navigation.navigator import Navigator, RobotEstimate
from ros_visualise.landmarks.navigation.state import FilterState

_GREEN, _RED, _GRAY, _BLUE = (0.1, 0.8, 0.2), (0.95, 0.15, 0.1), (0.6, 0.6, 0.6), (0.2, 0.5, 1.0)
_PLATE_M, _TEXT_M = 0.02, 0.25
_SHOWN_NS = 1_000_000_000  # so long a landmark keeps the colour of what became of it


def landmarks_of(navigator: Navigator, header: Header) -> Detections3D:
    """The landmarks that the robot is corrected by; one that may be in two poses has both."""
    chart, state = navigator.chart, navigator.state
    there = [
        _detection(one, state, navigator.common) for one in chart.landmarks.values() if one.is_used
    ]
    return Detections3D(tuple(there), header)


def tracks_of(
    navigator: Navigator, given: Mapping[str, LandmarkTrack]
) -> tuple[list[LandmarkTrack], Floats]:
    """The map, as `ros_visualise.landmarks.localization.map_file` writes it.

    And the covariance (6, 6) of what its landmarks are off together.

    Args:
        given: that of before; a landmark that was not seen is as it was.
    """
    chart, state, common = navigator.chart, navigator.state, navigator.common
    if navigator.settings.rules.mode is MapMode.FROZEN:
        return list(given.values()), common
    before = [one for name, one in given.items() if name not in chart.landmarks]
    found = [one for one in chart.landmarks.values() if one.is_used]
    if navigator.settings.rules.mode is MapMode.BUILD:
        common = _common(state, [one.key for one in found if one.is_turned])
        return [_track(one, state, 0.0) for one in found], common
    return [*before, *(_track(one, state, common) for one in found)], common


def _common(state: FilterState, keys: list[str]) -> Floats:
    """(6, 6) what tags are off together, of what the state has."""
    rows = np.array([np.arange(state.rows(key).start, state.rows(key).stop) for key in keys], int)
    rows = rows.ravel()
    return split(state.covariance[np.ix_(rows, rows)].reshape(len(keys), 6, len(keys), 6))[0]


def markers_of(navigator: Navigator, now: RobotEstimate, header: Header) -> MarkerArray:
    """The robot's ellipsoid, and the landmarks': green used, red refused with the reason."""
    axes_lengths, axes = ellipsoid(now.covariance[:3, :3])
    color = np.array([*(_BLUE if now.is_located else _RED), 0.4])
    place = now.T_map_base[:3, 3]
    drawn = [Marker(MarkerType.SPHERE, place, axes, axes_lengths, color, ns="robot", id=0)]
    for one in navigator.chart.landmarks.values():
        drawn += _landmark(navigator, one, header.stamp_ns)
    return MarkerArray(tuple(replace(one, header=header) for one in drawn))


def diagnostics_of(
    navigator: Navigator, now: RobotEstimate | None, header: Header
) -> DiagnosticArray:
    """Whether it knows where the robot is, how well, and what became of the last image."""
    judged = navigator.judged
    lost = not navigator.is_located
    said = navigator.trouble or "knows where the robot is"
    if not lost and judged.refused:
        said = f"refuses {', '.join(judged.refused)}"
    level = Level.ERROR if lost else Level.WARN if judged.refused else Level.OK
    sigmas = np.sqrt(np.diag(now.covariance)) if now else np.full(6, np.nan)
    values = {
        "mode": navigator.settings.rules.mode.value,
        "located": str(navigator.is_located),
        "position sigma (m)": f"{np.linalg.norm(sigmas[:3]):.3f}",
        "heading sigma (deg)": f"{np.degrees(sigmas[5]):.2f}",
        "found so far by": ", ".join(sorted(navigator.found_by)),
        "used": ", ".join(judged.used),
        "watched": ", ".join(judged.watched),
        "landmarks": str(sum(one.is_used for one in navigator.chart.landmarks.values())),
        **{f"refused {name}": why for name, why in judged.refused.items()},
        **{name: str(count) for name, count in navigator.counts.items()},
        "imu": _imu(navigator),
        "gps fixes used": str(navigator.past.gps.used),
        "gps fixes refused": str(navigator.past.gps.refused),
    }
    return DiagnosticArray((DiagnosticStatus("landmark_navigator", level, said, values),), header)


def _imu(navigator: Navigator) -> str:
    if navigator.past.is_imu_refused:
        return "contradicts the odometry: left out"
    return "used" if navigator.past.imu.is_there else "none"


def _pose(state: FilterState, key: str) -> tuple[Floats, Floats]:
    (place,) = state.indices([key])
    return state.landmarks_p[place], state.landmarks_R[place]


def _detection(one: Landmark, state: FilterState, common: Floats) -> Detection3D:
    hypotheses = []
    for key, weight in zip(one.keys, one.weights, strict=True):
        p, R = _pose(state, key)
        covariance = told_covariance(state, key, common)
        quat = rotations.from_matrix(R)
        hypotheses.append(Hypothesis(one.kind, weight, p, quat, covariance, one.number))
    first = hypotheses[0]
    return Detection3D(first.position_xyz, first.quat_xyzw, _size(one), tuple(hypotheses), one.name)


def _track(one: Landmark, state: FilterState, common: Floats | float) -> LandmarkTrack:
    p, R = _pose(state, one.key)
    branch = Branch(known(p, R, told_covariance(state, one.key, common)), 0.0)
    return LandmarkTrack(
        one.kind,
        one.number,
        one.is_turned,
        (branch,),
        one.last_ns,
        number=0 if one.is_turned else int(one.name.rpartition("_")[2]),
        size_xyz=_size(one),
        sizes=one.seen if one.side_m else 0,
        seen=one.seen,
    )


def _size(one: Landmark) -> Floats:
    return np.array([one.side_m, one.side_m, 0.0])


def _landmark(navigator: Navigator, one: Landmark, stamp_ns: int) -> list[Marker]:
    """A plate in the colour of what became of it, its ellipsoid, and why it is refused."""
    state, why = navigator.state, navigator.judged.refused.get(one.name, "")
    p, R = _pose(state, one.key)
    is_fresh = one.name in navigator.judged.used or stamp_ns - one.last_ns < _SHOWN_NS
    color = _RED if why else _GREEN if is_fresh and one.is_used else _GRAY
    number = zlib.crc32(one.name.encode()) & 0x7FFFFFFF
    lengths, axes = ellipsoid(told_covariance(state, one.key, navigator.common)[:3, :3])
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

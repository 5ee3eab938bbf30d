"""Messages of the navigator: landmarks, markers and diagnostics."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from typing import NamedTuple

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
from ros_visualise.data.header import read_only
from ros_visualise.data.markers import Colors, MarkerType
from ros_visualise.estimation.landmark import Landmark
from ros_visualise.estimation.landmark_map import ImageOutcome, MapMode
from ros_visualise.estimation.localization.common_error import split
from ros_visualise.estimation.localization.messages import ellipsoid
from ros_visualise.estimation.localization.track import LandmarkTrack
from ros_visualise.estimation.measuring import CAMERAS, CLOCK, FOCAL
from ros_visualise.estimation.navigator import Navigator, RobotEstimate
from ros_visualise.estimation.odometry import AXES, SCALES
from ros_visualise.estimation.resting import PER_LANDMARK, TWIST
from ros_visualise.estimation.robot import OwnStates
from ros_visualise.estimation.state import State
from ros_visualise.geometry import rotations
from ros_visualise.geometry.se3 import about_itself

Color = tuple[float, float, float]
_GREEN, _RED, _GRAY, _BLUE = (0.1, 0.8, 0.2), (0.95, 0.15, 0.1), (0.6, 0.6, 0.6), (0.2, 0.5, 1.0)
_PLATE_M, _TEXT_M = 0.02, 0.25
_IN_TURN = 12  # landmarks out of view, in each message
_SHOWN_NS = 1_000_000_000  # how long a landmark keeps the colour of its outcome

_ESTIMATED: tuple[tuple[str, OwnStates, int, float], ...] = (
    ("odometry distances too short by (%)", SCALES, 0, 100),
    *(
        (f"odometry rotated about {axis} (deg)", AXES, place, float(np.degrees(1)))
        for place, axis in enumerate("xyz")
    ),
    ("odometry rotation angles too small by (%)", SCALES, 1, 100),
    *(
        (f"camera {number} {what}", states, place, factor)
        for number, states in enumerate(CAMERAS, 1)
        for what, place, factor in (
            ("clock behind by (ms)", CLOCK, 1000.0),
            ("rotated about x (deg)", 1, np.degrees(1)),
            ("rotated about y (deg)", 2, np.degrees(1)),
            ("rotated about z (deg)", 3, np.degrees(1)),
            ("focal length too short by (%)", FOCAL, 100.0),
        )
    ),
)


class _Place(NamedTuple):
    """A reading of a landmark: its pose, and the covariance (6, 6) as in messages."""

    p: Floats
    R: Floats
    covariance: Floats


def _places(state: State, landmarks: Iterable[Landmark], common: Floats) -> dict[str, _Place]:
    """All readings of landmarks, by key; ``common`` (6, 6) is of the twist of the whole map."""
    keys = [key for one in landmarks for key in one.keys]
    R, p, twists = state.marginals(keys)
    change = np.array([about_itself(at) for at in p]).reshape(-1, 6, 6)
    covariances = change @ (twists + common) @ np.swapaxes(change, -1, -2)
    return dict(zip(keys, map(_Place, p, R, covariances), strict=True))


def tracks_of(
    navigator: Navigator, given: Mapping[str, LandmarkTrack]
) -> tuple[list[LandmarkTrack], Floats]:
    """The map as tracks, with the covariance (6, 6) that all landmarks share.

    Args:
        given: the previous map; landmarks that were not seen stay unchanged.
    """
    landmark_map, common = navigator.map, navigator.common
    mode = navigator.settings.rules.mode
    if mode is MapMode.FROZEN:
        return list(given.values()), common
    alone = np.zeros((6, 6)) if mode is MapMode.BUILD else common
    places = _places(navigator.belief.state, landmark_map.used, alone)
    found = [_track(one, places[one.key]) for one in landmark_map.used]
    if mode is MapMode.BUILD:
        return found, _common(
            navigator.state, [o.key for o in landmark_map.used if o.has_orientation]
        )
    before = [one for name, one in given.items() if name not in landmark_map.landmarks]
    return [*before, *found], common


def _common(state: State, keys: list[str]) -> Floats:
    """(6, 6) common covariance of the tags in the state."""
    rows = state.rows_of(keys).reshape(-1, PER_LANDMARK)[:, :TWIST].ravel()
    return split(state.P[np.ix_(rows, rows)].reshape(len(keys), 6, len(keys), 6))[0]


class _Shape(NamedTuple):
    """A reading of a landmark as it is shown: its orientation, and that of its ellipsoid."""

    p: Floats
    quat: Floats
    covariance: Floats
    lengths: Floats
    axes: Floats


def _shapes(places: Mapping[str, _Place]) -> dict[str, _Shape]:
    """Readings, by key."""
    if not places:
        return {}
    p, R, covariances = map(np.array, zip(*places.values(), strict=True))
    shapes = map(
        _Shape, p, rotations.from_matrix(R), covariances, *ellipsoid(covariances[:, :3, :3])
    )
    return dict(zip(places, shapes, strict=True))


class _LandmarkMessage(NamedTuple):
    """Messages of a landmark, and of what; its colour changes at ``until_ns``."""

    landmark: Landmark
    detection: Detection3D
    markers: list[Marker]
    until_ns: float


class RenewedMessages:
    """Messages of all landmarks: made anew for those in view, and for a few others in turn."""

    def __init__(self) -> None:
        self._made: dict[str, _LandmarkMessage] = {}
        self._turn = 0

    def of(
        self, navigator: Navigator, now: RobotEstimate, header: Header
    ) -> tuple[Detections3D, MarkerArray]:
        """The landmarks that correct the robot, and the ellipsoids of robot and all landmarks.

        An undecided landmark has both poses. Markers are green if used, red if rejected, with the
        reason.
        """
        landmarks = navigator.map.landmarks
        due = self._due(landmarks, navigator.outcome, header.stamp_ns)
        self._make(navigator, due, header)
        made = [self._made[name] for name in landmarks]
        self._made = dict(zip(landmarks, made, strict=True))
        used = tuple(one.detection for one in made if one.landmark.is_used)
        drawn = [_robot(now, header), *(marker for one in made for marker in one.markers)]
        return Detections3D(used, header), MarkerArray(tuple(drawn))

    def _due(
        self, landmarks: Mapping[str, Landmark], outcome: ImageOutcome, stamp_ns: int
    ) -> list[Landmark]:
        names = list(landmarks)
        turn = {names[(self._turn + n) % len(names)] for n in range(min(_IN_TURN, len(names)))}
        self._turn = (self._turn + _IN_TURN) % max(len(names), 1)
        return [
            one
            for name, one in landmarks.items()
            if name in turn
            or name in outcome.rejected
            or (made := self._made.get(name)) is None
            or made.landmark is not one
            or stamp_ns >= made.until_ns
        ]

    def _make(self, navigator: Navigator, due: list[Landmark], header: Header) -> None:
        outcome = navigator.outcome
        shapes = _shapes(_places(navigator.belief.state, due, navigator.common))
        for one in due:
            why, fades_ns = outcome.rejected.get(one.name, ""), one.last_ns + _SHOWN_NS
            is_fresh = one.name in outcome.used or header.stamp_ns < fades_ns
            color = _RED if why else _GREEN if is_fresh and one.is_used else _GRAY
            self._made[one.name] = _LandmarkMessage(
                one,
                _detection(one, shapes),
                _landmark(one, shapes[one.key], color, why, header),
                header.stamp_ns if why else fades_ns if is_fresh else np.inf,
            )


def _robot(now: RobotEstimate, header: Header) -> Marker:
    lengths, axes = ellipsoid(now.covariance[:3, :3])
    color = _rgba(_BLUE if now.is_located else _RED, 0.4)
    place = now.T_map_base[:3, 3]
    return Marker(MarkerType.SPHERE, place, axes, lengths, color, header=header, ns="robot", id=0)


def diagnostics_of(
    navigator: Navigator, now: RobotEstimate | None, header: Header
) -> DiagnosticArray:
    """Diagnostics: localized or why not, the uncertainty, and the outcome of the last image."""
    outcome, belief = navigator.outcome, navigator.belief
    lost = not navigator.is_located
    said = belief.reason or "localized"
    if not lost and belief.contradiction.any():
        metres = np.linalg.norm(belief.contradiction[:3])
        said = f"uncertain: the tags in view contradict the pose by {metres:.1f} m"
    elif not lost and outcome.rejected:
        said = f"rejects {', '.join(outcome.rejected)}"
    if not outcome.used and (advice := [t for n, t in outcome.advice.items() if n != "the robot"]):
        said = f"{said}; {max(advice, key=advice.count)}"
    for sensor, late_s in navigator.late_s.items():
        said = f"{said}; {sensor}: dropped, {late_s:.1f} s late; increase the parameter delay"
    is_fine = not (outcome.rejected or belief.contradiction.any() or belief.refusals)
    is_fine = is_fine and not navigator.late_s
    level = Level.ERROR if lost else Level.OK if is_fine else Level.WARN
    sigmas = np.sqrt(np.diag(now.covariance)) if now else np.full(6, np.nan)
    values = {
        "mode": navigator.settings.rules.mode.value,
        "located": str(navigator.is_located),
        "position sigma (m)": f"{np.linalg.norm(sigmas[:3]):.3f}",
        "heading sigma (deg)": f"{np.degrees(sigmas[5]):.2f}",
        "candidate pose supported by": ", ".join(sorted(belief.search.names)),
        "used": ", ".join(outcome.used),
        "pending": ", ".join(outcome.pending),
        "landmarks": str(len(navigator.map.used)),
        **{f"rejected {name}": why for name, why in outcome.rejected.items()},
        "imu": _imu(navigator),
        **dict(_estimated(navigator)),
        **{name: str(count) for name, count in navigator.counts.items()},
    }
    return DiagnosticArray((DiagnosticStatus("landmark_navigator", level, said, values),), header)


def _imu(navigator: Navigator) -> str:
    belief = navigator.belief
    if belief.stamp_ns is not None and belief.imu.ignored_until_ns > belief.stamp_ns:
        return "ignored: contradicts the odometry"
    return "used" if navigator.has_imu else "none"


def _estimated(navigator: Navigator) -> Iterator[tuple[str, str]]:
    """Estimated errors of the sensors, with their standard deviations."""
    state = navigator.belief.state
    sigmas = np.sqrt(np.diag(state.P))
    for label, states, place, factor in _ESTIMATED:
        sigma = sigmas[states.rows][place]
        if sigma > 0:
            value = state.robot[states][place]
            yield label, f"{value * factor:.2f} +- {sigma * factor:.2f}"


def _detection(one: Landmark, shapes: Mapping[str, _Shape]) -> Detection3D:
    several = zip((shapes[key] for key in one.keys), one.weights, strict=True)
    hypotheses = tuple(
        Hypothesis(one.kind, weight, shape.p, shape.quat, shape.covariance, one.number)
        for shape, weight in several
    )
    first = shapes[one.key]
    return Detection3D(first.p, first.quat, _size(one), hypotheses, one.name)


def _track(one: Landmark, place: _Place) -> LandmarkTrack:
    return LandmarkTrack.of_map(
        (one.kind, one.number),
        place,
        _size(one),
        one.seen,
        turned=one.has_orientation,
        last_ns=one.last_ns,
        number=0 if one.has_orientation else int(one.name.rpartition("_")[2]),
    )


def _size(one: Landmark) -> Floats:
    return np.array([one.side_m, one.side_m, 0.0])


def _landmark(one: Landmark, shape: _Shape, color: Color, why: str, header: Header) -> list[Marker]:
    """A plate in the colour of its outcome, the ellipsoid, and the reason of a rejection."""
    number = zlib.crc32(one.name.encode()) & 0x7FFFFFFF
    p, quat, _, lengths, axes = shape
    side = one.side_m or _TEXT_M
    plate, above = np.array([side, side, _PLATE_M]), np.array([0, 0, side / 2 + _TEXT_M])
    label = f"{one.name}: {why}" if why else one.name
    cube, sphere, text = MarkerType.CUBE, MarkerType.SPHERE, MarkerType.TEXT_VIEW_FACING
    return [
        Marker(cube, p, quat, plate, _rgba(color, 0.8), ns="plate", id=number, header=header),
        Marker(sphere, p, axes, lengths, _rgba(color, 0.3), ns="error", id=number, header=header),
        Marker(
            text,
            p + above,
            scale_xyz=np.full(3, _TEXT_M),
            color_rgba=_rgba(color, 1.0),
            text=label,
            ns="label",
            id=number,
            header=header,
        ),
    ]


@cache
def _rgba(color: Color, alpha: float) -> Colors:
    return read_only(np.array([*color, alpha], np.float32))

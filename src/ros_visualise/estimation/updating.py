"""The filter's update by an image: gates, robust weights, and considered states."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.camera_view import CameraView
from ros_visualise.estimation.measuring import CAMERAS, LinearizedPair, Pair, measure
from ros_visualise.estimation.robot import POSE, own_states
from ros_visualise.estimation.state import PER_LANDMARK, Indices, Mask, State
from ros_visualise.landmarks.gates import Innovation

GROUND = own_states("height of the ground", 1)
"""Error of the ground's given height, metres: positive if the ground is higher."""

_ROUNDS = 3  # of linearisation
_CONVERGED = 0.02  # largest change in the last round, in prior standard deviations
_LEAST = 1e-9  # metres and radians
_HUBER = 2.5  # Huber threshold of corners, standard deviations
_BEHIND = 1e6  # squared distance of what is behind the camera
_OF_CAMERA = slice(POSE.stop, POSE.stop + 5)


def fits(view: CameraView, pairs: Sequence[Pair], state: State) -> list[Innovation]:
    """The innovation of each pair, separately."""
    return [
        _fit(one, _columns(view, [pair], state), state)
        for pair, one in zip(pairs, measure(view, pairs, state), strict=True)
    ]


def update(
    state: State, view: CameraView, pairs: Sequence[Pair], free: Mask | None = None
) -> State:
    """The state updated by the sightings of an image.

    ``free`` rows alone are corrected, see `State.corrected`. The update iterates the linearization,
    and gives corners that fit badly less weight.

    Source: B. Bell, F. Cathey, The iterated Kalman filter update as a Gauss-Newton method, 1993; P.
    Huber, Robust Statistics, 1981, section 7.
    """
    columns = _columns(view, pairs, state)
    P = state.P
    error = np.zeros(len(P))
    settled = _CONVERGED * np.sqrt(np.maximum(np.diag(P)[columns], 0)) + _LEAST
    moved = state
    for turn in range(_ROUNDS):
        residual, H, noise = _stacked(measure(view, pairs, moved), len(columns), turn > 0)
        PH = P[:, columns] @ H.T
        innovation = residual + H @ error[columns]
        before = error
        error = PH @ np.linalg.solve(H @ PH[columns] + noise, innovation)
        if not np.isfinite(error).all():  # the camera got behind a landmark
            return state
        if free is not None:
            error[~free] = 0
        if (np.abs(error - before)[columns] < settled).all():
            break
        moved = state.moved(error)
    return state.corrected(columns, H, innovation, noise, free)


def level(state: State, up: Floats, sigma: float) -> tuple[State, Innovation]:
    """The state with the robot's pose corrected by the odometry's vertical.

    Args:
        up: (3,) the odometry's vertical, in the robot's axes.
        sigma: its standard deviation, rad.
    """
    P, turns = state.P, np.arange(3, 6)
    moved, error = state, np.zeros(len(P))
    noise = np.eye(2) * sigma**2
    first = None
    for _ in range(_ROUNDS):
        x, y, z = moved.robot.R @ up
        H = np.array([[0, z, -y], [-z, 0, x]])
        residual = -np.array([x, y])
        PH = P[:, turns] @ H.T
        spread = H @ PH[turns] + noise
        if first is None:
            first = Innovation.of(residual, spread, noise, 0.0 if z > 0 else _BEHIND)
        innovation = residual + H @ error[turns]
        error = PH @ np.linalg.solve(spread, innovation)
        moved = state.moved(error)
    assert first is not None
    return state.corrected(turns, H, innovation, noise), first


def stand_on(state: State, key: str, height_m: float, roughness_m: float) -> State:
    """The state with a landmark on the ground, whose error all landmarks on it share."""
    columns = np.array([state.rows(key).start + 2, GROUND.rows.start])
    z = state.landmarks_p[state.indices([key])[0], 2]
    residual = np.array([height_m + state.robot[GROUND][0] - z])
    return state.corrected(columns, np.array([[1.0, -1.0]]), residual, np.eye(1) * roughness_m**2)


def _columns(view: CameraView, pairs: Sequence[Pair], state: State) -> Indices:
    """The states that pairs depend on: the robot's pose, the camera, and their landmarks."""
    camera = CAMERAS[view.camera].rows
    landmarks = state.rows_of([pair.key for pair in pairs], robot=0)
    return np.concatenate([np.arange(POSE.stop), np.arange(camera.start, camera.stop), landmarks])


def _fit(one: LinearizedPair, columns: Indices, state: State) -> Innovation:
    if not np.isfinite(one.residual).all():
        return Innovation(_BEHIND, len(one.residual), -_BEHIND)
    H = np.hstack([one.of_robot, one.of_camera, one.of_landmark])
    spread = H @ state.P[np.ix_(columns, columns)] @ H.T + one.noise
    return Innovation.of(one.residual, spread, one.noise)


def _stacked(
    several: Sequence[LinearizedPair], columns: int, robust: bool
) -> tuple[Floats, Floats, Floats]:
    """Residual (m,), derivative (m, columns) and noise (m, m) of all pairs of an image."""
    total = sum(len(one.residual) for one in several)
    H, noise = np.zeros((total, columns)), np.zeros((total, total))
    start = 0
    for number, one in enumerate(several):
        rows = slice(start, start + len(one.residual))
        own = _OF_CAMERA.stop + PER_LANDMARK * number
        H[rows, POSE], H[rows, _OF_CAMERA] = one.of_robot, one.of_camera
        H[rows, own : own + PER_LANDMARK] = one.of_landmark
        inflation = _inflation(one) if robust else np.ones(len(one.residual))
        noise[rows, rows] = one.noise * inflation[:, None] * inflation
        start = rows.stop
    return np.concatenate([one.residual for one in several]), H, noise


def _inflation(one: LinearizedPair) -> Floats:
    """(k,) factors on the deviations, larger for corners that fit badly."""
    if len(one.residual) != 8:
        return np.ones(len(one.residual))
    off = np.sqrt((one.residual**2 / np.diag(one.noise)).reshape(4, 2).sum(axis=1))
    return np.repeat(np.sqrt(np.maximum(off / _HUBER, 1.0)), 2)

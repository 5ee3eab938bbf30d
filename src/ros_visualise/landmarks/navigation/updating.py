"""The filter's update by an image: gates, robust weights, and considered states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.landmarks.localization.estimate import GATES
from ros_visualise.landmarks.navigation.camera_view import CameraView
from ros_visualise.landmarks.navigation.measuring import LinearizedPair, Pair, measure
from ros_visualise.landmarks.navigation.robot import CORE, POSE
from ros_visualise.landmarks.navigation.state import PER_LANDMARK, FilterState

_ROUNDS = 3  # of linearisation
_CONVERGED = 0.02  # largest change in the last round, in prior standard deviations
_LEAST = 1e-9  # metres and radians
_HUBER = 2.5  # Huber threshold of corners, standard deviations
_BEHIND = 1e6  # squared distance of what is behind the camera


class Innovation(NamedTuple):
    """Consistency of a sighting with the state: squared Mahalanobis distance of ``size`` numbers.

    ``evidence`` is the log-likelihood, relative to that of the noise alone.
    """

    distance2: float
    size: int
    evidence: float

    @property
    def is_inlier(self) -> bool:
        """True if it passes the 99.9% gate."""
        return self.distance2 < GATES[self.size]


def fits(view: CameraView, pairs: Sequence[Pair], state: FilterState) -> list[Innovation]:
    """The innovation of each pair, separately."""
    return [
        _fit(one, _columns([pair], state), state)
        for pair, one in zip(pairs, measure(view, pairs, state), strict=True)
    ]


def update(
    state: FilterState, view: CameraView, pairs: Sequence[Pair], free: Sequence[slice]
) -> FilterState:
    """The state updated by the sightings of an image.

    Only ``free`` rows are corrected; the others are considered: their errors count, but they are
    not estimated. The update iterates the linearization, and gives corners that fit badly less
    weight.

    Source: S. F. Schmidt, Application of state-space methods to navigation problems, 1966 (the
    considered states); B. Bell, F. Cathey, The iterated Kalman filter update as a Gauss-Newton
    method, 1993; P. Huber, Robust Statistics, 1981, section 7.
    """
    columns = _columns(pairs, state)
    fixed = np.ones(len(state.covariance), bool)
    for rows in free:
        fixed[rows] = False
    P = state.covariance
    error = np.zeros(len(P))
    settled = _CONVERGED * np.sqrt(np.maximum(np.diag(P)[columns], 0)) + _LEAST
    moved = state
    for turn in range(_ROUNDS):
        residual, H, noise = _stacked(measure(view, pairs, moved), columns, turn > 0)
        PH = P[:, columns] @ H.T
        spread = H @ PH[columns] + noise
        before = error
        error = PH @ np.linalg.solve(spread, residual + H @ error[columns])
        if not np.isfinite(error).all():  # the camera got behind a landmark
            return state
        error[fixed] = 0
        moved = state.moved(error)
        if (np.abs(error - before)[columns] < settled).all():
            break
    change = PH @ np.linalg.solve(spread, PH.T)
    if fixed.any():
        change[np.ix_(fixed, fixed)] = 0
    P = P - change
    moved.covariance = (P + P.T) / 2
    return moved


def level(state: FilterState, up: Floats, sigma: float) -> tuple[FilterState, Innovation]:
    """The state with the robot's pose corrected by the odometry's vertical.

    Args:
        up: (3,) the odometry's vertical, in the robot's axes.
        sigma: its standard deviation, rad.
    """
    P = state.covariance
    moved, error = state, np.zeros(len(P))
    first = None
    for _ in range(_ROUNDS):
        x, y, z = moved.R @ up
        H = np.array([[0, z, -y], [-z, 0, x]])
        residual = -np.array([x, y])
        PH = P[:, 3:6] @ H.T
        spread = H @ PH[3:6] + np.eye(2) * sigma**2
        if first is None:
            beyond = 0.0 if z > 0 else _BEHIND
            first = _compared(residual, spread, np.eye(2) * sigma**2, beyond)
        error = PH @ np.linalg.solve(spread, residual + H @ error[3:6])
        moved = state.moved(error)
    P = P - PH @ np.linalg.solve(spread, PH.T)
    moved.covariance = (P + P.T) / 2
    assert first is not None
    return moved, first


def stand_on(state: FilterState, key: str, height_m: float, sigma_m: float) -> None:
    """Constrain a landmark to the ground, which also corrects all that is correlated with it.

    The ground's error counts once for each landmark.
    """
    P, row = state.covariance, state.rows(key).start + 2
    residual = height_m - state.landmarks_p[state.indices([key])[0], 2]
    gain = P[:, row] / (P[row, row] + sigma_m**2)
    moved = state.moved(gain * residual)
    state.robot, state.landmarks_R = moved.robot, moved.landmarks_R
    state.landmarks_p = moved.landmarks_p
    state.covariance = P - np.multiply.outer(gain, P[row])


def _columns(pairs: Sequence[Pair], state: FilterState) -> npt.NDArray[np.intp]:
    """The states that pairs depend on: the robot's pose, and their landmarks."""
    starts = CORE + PER_LANDMARK * state.indices([pair.key for pair in pairs])
    landmarks = (starts[:, None] + np.arange(PER_LANDMARK)).ravel()
    return np.concatenate([np.arange(POSE.stop), landmarks])


def _fit(one: LinearizedPair, columns: npt.NDArray[np.intp], state: FilterState) -> Innovation:
    if not np.isfinite(one.residual).all():
        return Innovation(_BEHIND, len(one.residual), -_BEHIND)
    H = np.hstack([one.of_robot, one.of_landmark])
    spread = H @ state.covariance[np.ix_(columns, columns)] @ H.T + one.noise
    return _compared(one.residual, spread, one.noise)


def _compared(residual: Floats, spread: Floats, noise: Floats, beyond: float = 0.0) -> Innovation:
    distance2 = float(residual @ np.linalg.solve(spread, residual)) + beyond
    volume = float(np.linalg.slogdet(noise)[1] - np.linalg.slogdet(spread)[1])
    return Innovation(distance2, len(residual), (volume - distance2) / 2)


def _stacked(
    several: Sequence[LinearizedPair], columns: npt.NDArray[np.intp], robust: bool
) -> tuple[Floats, Floats, Floats]:
    """Residual (m,), derivative (m, columns) and noise (m, m) of all pairs of an image."""
    total = sum(len(one.residual) for one in several)
    H, noise = np.zeros((total, len(columns))), np.zeros((total, total))
    start = 0
    for number, one in enumerate(several):
        rows = slice(start, start + len(one.residual))
        own = POSE.stop + PER_LANDMARK * number
        H[rows, POSE] = one.of_robot
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

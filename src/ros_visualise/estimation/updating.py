"""The filter's update by an image: gates, robust weights, and considered states."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.camera_view import CameraView
from ros_visualise.estimation.gates import Innovation
from ros_visualise.estimation.measuring import CAMERAS, TURN, LinearizedPairs, Pair, measure
from ros_visualise.estimation.resting import PER_LANDMARK, Indices
from ros_visualise.estimation.robot import POSE, own_states
from ros_visualise.estimation.state import Mask, State

GROUND = own_states("height of the ground", 1)
"""Error of the ground's given height, metres: positive if the ground is higher."""

_ROUNDS = 3  # of linearisation
_CONVERGED = 0.02  # largest change in the last round, in prior standard deviations
_LEAST = 1e-9  # metres and radians
_HUBER = 2.5  # Huber threshold of corners, standard deviations
_BEHIND = 1e6  # squared distance of what is behind the camera
_OF_CAMERA = slice(POSE.stop, POSE.stop + 5)
_TURN = slice(POSE.stop + TURN.start, POSE.stop + TURN.stop)


def fits(view: CameraView, pairs: Sequence[Pair], state: State) -> list[Innovation]:
    """The innovation of each pair, separately."""
    columns = _columns(view, pairs, state)
    found: dict[int, Innovation] = {}
    for several in measure(view, pairs, state):
        each = _of_each(columns, several)
        H = np.concatenate([several.of_shared, several.of_landmark], axis=2)
        P = state.P[each[:, :, None], each[:, None, :]]
        noise = _noise_of_each(view, several)
        spread = H @ P @ np.swapaxes(H, 1, 2) + noise
        compared = _innovations(several.residual, spread, noise)
        found |= zip(several.places.tolist(), compared, strict=True)
    return [found[number] for number in range(len(pairs))]


def together(
    view: CameraView, pairs: Sequence[Pair], state: State, rows: slice, variance: float
) -> tuple[Innovation, Innovation]:
    """The innovation of all pairs as one: of the state, and with more variance in some rows."""
    columns = _columns(view, pairs, state)
    several = measure(view, pairs, state)
    H, noise = ImageJacobian(several), _noise(view, several)
    residual = np.concatenate([one.residual.ravel() for one in several])
    spread = H @ (H @ state.P[columns][:, columns]).T + noise
    more = H @ np.eye(len(columns))[:, (columns >= rows.start) & (columns < rows.stop)]
    as_stated = next(_innovations(residual[None], spread[None], noise[None]))
    if not np.isfinite(residual).all():
        return as_stated, as_stated
    # with more variance, by the matrix inversion and determinant lemmas
    solved = np.linalg.solve(spread, more)
    inner = np.eye(more.shape[1]) / variance + more.T @ solved
    across = solved.T @ residual
    distance2 = as_stated.distance2 - float(across @ np.linalg.solve(inner, across))
    volume = float(np.linalg.slogdet(variance * inner)[1])
    change = (as_stated.distance2 - distance2 - volume) / 2
    return as_stated, Innovation(distance2, len(residual), as_stated.evidence + change)


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
    P = state.P[columns][:, columns]
    is_free = np.ones(len(columns), bool) if free is None else free[columns]
    error = np.zeros(len(columns))
    settled = _settled(np.diag(P))
    moved = state
    for turn in range(_ROUNDS):
        several = _linearized(view, pairs, moved, turn)
        H, noise = ImageJacobian(several), _noise(view, several)
        innovation = np.concatenate([one.residual.ravel() for one in several]) + H @ error
        if not np.isfinite(innovation).all():  # the camera got behind a landmark
            return state
        if turn == _ROUNDS - 1:
            break
        PH, before = (H @ P).T, error
        error = PH @ np.linalg.solve(H @ PH + noise, innovation)
        error[~is_free] = 0
        if (np.abs(error - before) < settled).all():
            break
        every = np.zeros(state.size)
        every[columns] = error
        moved = state.moved(every)
    return state.corrected(columns, H, innovation, noise, free)


def update_each(state: State, view: CameraView, pairs: Sequence[Pair]) -> State:
    """The state with each landmark updated by its own sighting alone, and nothing else.

    The same as `update` by one pair after the other, with its landmark free alone.
    """
    columns = _columns(view, pairs, state)
    P = state.P[columns][:, columns]
    settled = _settled(np.diag(P))[_OF_CAMERA.stop :].reshape(-1, PER_LANDMARK)
    error, moved = np.zeros((len(pairs), PER_LANDMARK)), state
    own, every = columns[_OF_CAMERA.stop :], np.zeros(state.size)
    for turn in range(_ROUNDS):
        several = _linearized(view, pairs, moved, turn)
        gains = [_own_gain(view, one, P) for one in several]
        before, error = error, np.empty_like(error)
        for one, gain in zip(several, gains, strict=True):
            innovation = one.residual[..., None] + one.of_landmark @ before[one.places, :, None]
            error[one.places] = (gain @ innovation)[..., 0]
        kept = [pair for pair, one in zip(pairs, error, strict=True) if np.isfinite(one).all()]
        if len(kept) < len(pairs):  # the camera got behind a landmark
            return update_each(state, view, kept) if kept else state
        if turn == _ROUNDS - 1 or (np.abs(error - before) < settled).all():
            break
        every[own] = error.ravel()
        moved = state.moved(every)
    H, gain = ImageJacobian(several), _diagonal(gains, several)
    HP = H @ state.joint[columns]
    spread = H @ HP[:, columns].T + _noise(view, several)
    return state.corrected_in(own, error.ravel(), gain @ HP, gain @ spread @ gain.T)


def _own_gain(view: CameraView, several: LinearizedPairs, P: Floats) -> Floats:
    """(G, 7, k) gains of the landmarks alone; P is of the states that all pairs depend on."""
    each = _of_each(np.arange(len(P)), several)
    H = np.concatenate([several.of_shared, several.of_landmark], axis=2)
    HP = H @ P[each[:, :, None], each[:, None, :]]
    spread = HP @ np.swapaxes(H, 1, 2) + _noise_of_each(view, several)
    return np.swapaxes(np.linalg.solve(spread, HP[..., _OF_CAMERA.stop :]), 1, 2)


def _diagonal(gains: Sequence[Floats], several: Sequence[LinearizedPairs]) -> Floats:
    """(7 K, k) gain of all K landmarks, of theirs (G, 7, k) by group."""
    count, total = sum(map(len, gains)), sum(one.residual.size for one in several)
    whole, start = np.zeros((count, PER_LANDMARK, total)), 0
    for gain, one in zip(gains, several, strict=True):
        columns = start + np.arange(one.residual.size).reshape(one.residual.shape)
        rows = np.arange(PER_LANDMARK)[:, None]
        whole[one.places[:, None, None], rows, columns[:, None]] = gain
        start += one.residual.size
    return whole.reshape(-1, total)


def _settled(variances: Floats) -> Floats:
    """Changes below which the linearization has converged."""
    return _CONVERGED * np.sqrt(np.maximum(variances, 0)) + _LEAST


def _linearized(
    view: CameraView, pairs: Sequence[Pair], state: State, turn: int
) -> list[LinearizedPairs]:
    several = measure(view, pairs, state)
    return [_robust(one) for one in several] if turn else several


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
    landmarks = state.rows_of([pair.key for pair in pairs])
    return np.concatenate([np.arange(POSE.stop), np.arange(camera.start, camera.stop), landmarks])


def _of_each(columns: Indices, several: LinearizedPairs) -> Indices:
    """(G, 18) the states that each pair depends on, of those of all pairs."""
    shared, own = columns[: _OF_CAMERA.stop], columns[_OF_CAMERA.stop :].reshape(-1, PER_LANDMARK)
    return np.hstack([np.tile(shared, (len(several.places), 1)), own[several.places]])


def _innovations(residuals: Floats, spreads: Floats, noises: Floats) -> Iterator[Innovation]:
    """Innovations of residuals (G, k) with covariances (G, k, k)."""
    is_seen = np.isfinite(residuals.sum(axis=1))
    seen = np.where(is_seen[:, None], residuals, 0.0)
    distances2 = (seen * np.linalg.solve(spreads, seen[..., None])[..., 0]).sum(axis=1)
    volumes = np.linalg.slogdet(noises)[1] - np.linalg.slogdet(spreads)[1]
    evidences = np.where(is_seen, (volumes - distances2) / 2, -_BEHIND)
    distances2 = np.where(is_seen, distances2, _BEHIND)
    for distance2, evidence in zip(distances2.tolist(), evidences.tolist(), strict=True):
        yield Innovation(distance2, residuals.shape[1], evidence)


class ImageJacobian:
    """Derivative (k, m) of an image's measurements by the m states that they depend on.

    ``H @ values`` multiplies it: each measurement depends on what all share, and one landmark.
    """

    def __init__(self, several: Sequence[LinearizedPairs]) -> None:
        self._several = several

    def __matmul__(self, values: Floats) -> Floats:
        columns = values.reshape(len(values), -1)
        shared, own = columns[: _OF_CAMERA.stop], columns[_OF_CAMERA.stop :]
        own = own.reshape(-1, PER_LANDMARK, columns.shape[1])
        found = np.concatenate(
            [
                one.of_shared.reshape(-1, len(shared)) @ shared
                + (one.of_landmark @ own[one.places]).reshape(-1, own.shape[2])
                for one in self._several
            ]
        )
        return found.reshape(-1, *values.shape[1:])


def _robust(one: LinearizedPairs) -> LinearizedPairs:
    """The same with more noise in tags' corners that fit badly."""
    if one.residual.shape[1] != 8:
        return one
    several = one.residual**2 / np.diagonal(one.noise, axis1=1, axis2=2)
    off = np.sqrt(several.reshape(-1, 4, 2).sum(axis=2))
    factors = np.repeat(np.sqrt(np.maximum(off / _HUBER, 1.0)), 2, axis=1)
    return one._replace(noise=one.noise * factors[:, :, None] * factors[:, None, :])


def _noise_of_each(view: CameraView, several: LinearizedPairs) -> Floats:
    """(G, k, k) noise of pairs: of what was seen, and of the camera's attitude."""
    by_turn = several.of_shared[..., _TURN]
    noise: Floats = several.noise + view.turn_variance * (by_turn @ np.swapaxes(by_turn, 1, 2))
    return noise


def _noise(view: CameraView, several: Sequence[LinearizedPairs]) -> Floats:
    """(k, k) noise of all pairs of an image, which share that of the camera's attitude."""
    by_turn = np.concatenate([one.of_shared[..., _TURN].reshape(-1, 3) for one in several])
    noise: Floats = view.turn_variance * (by_turn @ by_turn.T)
    start = 0
    for one in several:
        rows = start + np.arange(one.residual.size).reshape(one.residual.shape)
        noise[rows[:, :, None], rows[:, None, :]] += one.noise
        start += one.residual.size
    return noise

"""The filter's update by an image: gates, robust weights, and considered states."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.camera_view import CameraView
from ros_visualise.estimation.measuring import CAMERAS, LinearizedPair, Pair, measure
from ros_visualise.estimation.resting import PER_LANDMARK, Indices
from ros_visualise.estimation.robot import POSE, own_states
from ros_visualise.estimation.state import Mask, State
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
    columns = _columns(view, pairs, state)
    shared, own = columns[: _OF_CAMERA.stop], columns[_OF_CAMERA.stop :].reshape(-1, PER_LANDMARK)
    found: dict[int, Innovation] = {}
    for group in _groups(measure(view, pairs, state)):
        each = np.hstack([np.tile(shared, (len(group.places), 1)), own[group.places]])
        H = np.concatenate([group.of_shared, group.of_landmark], axis=2)
        P = state.P[each[:, :, None], each[:, None, :]]
        spread = H @ P @ np.swapaxes(H, 1, 2) + group.noise
        compared = _innovations(group.residual, spread, group.noise)
        found |= zip(group.places.tolist(), compared, strict=True)
    return [found[number] for number in range(len(pairs))]


def together(
    view: CameraView, pairs: Sequence[Pair], state: State, rows: slice, variance: float
) -> tuple[Innovation, Innovation]:
    """The innovation of all pairs as one: of the state, and with more variance in some rows."""
    columns = _columns(view, pairs, state)
    residual, H, noise = _stacked(measure(view, pairs, state), len(columns), robust=False)
    spread = H @ state.P[np.ix_(columns, columns)] @ H.T + noise
    more = H[:, (columns >= rows.start) & (columns < rows.stop)]
    both = np.array([spread, spread + variance * more @ more.T])
    first, second = _innovations(np.tile(residual, (2, 1)), both, np.array([noise, noise]))
    return first, second


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
    P = state.P[np.ix_(columns, columns)]
    is_free = np.ones(len(columns), bool) if free is None else free[columns]
    error = np.zeros(len(columns))
    settled = _CONVERGED * np.sqrt(np.maximum(np.diag(P), 0)) + _LEAST
    moved = state
    for turn in range(_ROUNDS):
        residual, H, noise = _stacked(measure(view, pairs, moved), len(columns), turn > 0)
        PH = P @ H.T
        innovation = residual + H @ error
        before = error
        error = PH @ np.linalg.solve(H @ PH + noise, innovation)
        if not np.isfinite(error).all():  # the camera got behind a landmark
            return state
        error[~is_free] = 0
        if (np.abs(error - before) < settled).all():
            break
        every = np.zeros(state.size)
        every[columns] = error
        moved = state.moved(every)
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
    landmarks = state.rows_of([pair.key for pair in pairs])
    return np.concatenate([np.arange(POSE.stop), np.arange(camera.start, camera.stop), landmarks])


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


class _PairGroup(NamedTuple):
    """G linearized pairs of k numbers each.

    ``places`` (G,) are theirs among all pairs, ``residual`` (G, k), ``of_shared`` (G, k, 11) the
    derivatives by the robot's twist and the camera, ``of_landmark`` (G, k, 6), ``noise`` (G, k, k).
    """

    places: Indices
    residual: Floats
    of_shared: Floats
    of_landmark: Floats
    noise: Floats

    def robust(self) -> _PairGroup:
        """The same with more noise in tags' corners that fit badly."""
        if self.residual.shape[1] != 8:
            return self
        several = self.residual**2 / np.diagonal(self.noise, axis1=1, axis2=2)
        off = np.sqrt(several.reshape(-1, 4, 2).sum(axis=2))
        factors = np.repeat(np.sqrt(np.maximum(off / _HUBER, 1.0)), 2, axis=1)
        return self._replace(noise=self.noise * factors[:, :, None] * factors[:, None, :])


def _groups(several: Sequence[LinearizedPair]) -> Iterator[_PairGroup]:
    """Pairs of the same size each."""
    sizes = np.array([len(one.residual) for one in several])
    for size in np.unique(sizes):
        places = np.flatnonzero(sizes == size)
        group = [several[place] for place in places.tolist()]
        of_robot, of_camera = (
            np.array([getattr(one, name) for one in group]) for name in ("of_robot", "of_camera")
        )
        yield _PairGroup(
            places,
            np.array([one.residual for one in group]),
            np.concatenate([of_robot, of_camera], axis=2),
            np.array([one.of_landmark for one in group]),
            np.array([one.noise for one in group]),
        )


def _stacked(
    several: Sequence[LinearizedPair], columns: int, robust: bool
) -> tuple[Floats, Floats, Floats]:
    """Residual (m,), derivative (m, columns) and noise (m, m) of all pairs of an image."""
    total = sum(len(one.residual) for one in several)
    residual, H, noise = np.zeros(total), np.zeros((total, columns)), np.zeros((total, total))
    start = 0
    for group in _groups(several):
        group = group.robust() if robust else group
        count, size = group.residual.shape
        rows = start + np.arange(count * size).reshape(count, size)
        residual[rows], H[rows, : _OF_CAMERA.stop] = group.residual, group.of_shared
        own = _OF_CAMERA.stop + PER_LANDMARK * group.places[:, None] + np.arange(PER_LANDMARK)
        H[rows[:, :, None], own[:, None, :]] = group.of_landmark
        noise[rows[:, :, None], rows[:, None, :]] = group.noise
        start += count * size
    return residual, H, noise

"""The filter's state: the robot and landmarks, with one covariance.

The first `core()` errors are the robot's own (`ros_visualise.estimation.robot`). Seven follow
for each landmark: its twist, and the logarithm of a tag's size by the stated one. The errors of
a rotation or a size that the landmark lacks stay zero.

A correction costs the square of the number of landmarks. So a state of many landmarks is divided:
the *active* ones are corrected at once, and the errors that they had at the division stay beside
them, as rows of the same matrix, although nothing is known of them:

    joint = [ P        change       ]
            [ change.T -information ]

``change`` takes errors at the division to those of today, and ``information`` and ``gradient`` are
what was learnt of the former. A propagation or correction treats all rows alike. The *resting*
landmarks depend on the measurements since only by these errors, so they gain by them exactly when
they become active again.

Source: J. Guivant, E. Nebot, Optimization of the simultaneous localization and map-building
algorithm for real-time implementation, 2001 (the division); A. Bryson, M. Frazier, Smoothing for
linear and nonlinear dynamic systems, 1963 (the sums).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from copy import copy
from dataclasses import replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.estimation.resting import (
    PER_LANDMARK,
    TWIST,
    Indices,
    LandmarkPoses,
    Resting,
    Whole,
    rows_of,
)
from ros_visualise.estimation.robot import (
    BEFORE,
    DATUM,
    GRAVITY,
    POSE,
    VELOCITY,
    YAW,
    RobotState,
    core,
)
from ros_visualise.geometry import se3

Mask = npt.NDArray[np.bool_]


class Jacobian(Protocol):
    """A matrix (k, m), perhaps sparse."""

    def __matmul__(self, values: Floats, /) -> Floats:
        """Its product with (m, ...)."""


_AT_A_TIME = 32  # landmarks
_ROWS_AT_A_TIME = 32


class State:
    """The estimate at one time. A `copy` is independent, and copies its arrays when they change.

    Attributes:
        robot: see `RobotState`.
        landmarks: the active ones.
        joint: (n + m, n + m), n = core() + 7 for each active landmark; see above.
        gradient: (m,) see above.
        resting: the other landmarks, if any.
    """

    def __init__(self, robot: RobotState | None = None, P: Floats | None = None) -> None:
        self.robot = robot or RobotState()
        self.landmarks = LandmarkPoses.none()
        self.joint = np.zeros((core(), core())) if P is None else P
        self.gradient: Floats = np.zeros(0)
        self.resting: Resting | None = None
        self._is_shared = True

    def copy(self) -> State:
        """An independent copy."""
        self._is_shared = True
        return copy(self)

    def _own(self) -> Floats:
        """The joint matrix, for changes in place."""
        if self._is_shared:
            self._set(self.joint.copy())
        return self.joint

    def _set(self, joint: Floats) -> None:
        """Replace the joint matrix by one that nothing else refers to."""
        self.joint, self._is_shared = joint, False

    @property
    def size(self) -> int:
        """Number n of errors of the robot and the active landmarks."""
        return core() + PER_LANDMARK * len(self.landmarks.keys)

    @property
    def P(self) -> Floats:  # noqa: N802
        """(n, n) their covariance."""
        P: Floats = self.joint[: self.size, : self.size]
        return P

    @property
    def keys(self) -> list[str]:
        """Names of the active landmarks' readings, in order."""
        return self.landmarks.keys

    @property
    def landmarks_R(self) -> Floats:  # noqa: N802
        """(L, 3, 3) rotations of the active landmarks."""
        return self.landmarks.R

    @property
    def landmarks_p(self) -> Floats:
        """(L, 3) positions of the active landmarks."""
        return self.landmarks.p

    @property
    def first_p(self) -> Floats:
        """(L, 3) first estimated positions of the active landmarks."""
        return self.landmarks.first_p

    def rows(self, key: str) -> slice:
        """The rows of a landmark's twist in the covariance."""
        start = core() + PER_LANDMARK * self.keys.index(key)
        return slice(start, start + TWIST)

    def size_of(self, key: str) -> slice:
        """The row of the size of a landmark in the covariance."""
        end = self.rows(key).stop
        return slice(end, end + 1)

    def size_error(self, key: str) -> tuple[float, float]:
        """By how much a tag is larger than stated, as a fraction, and its standard deviation."""
        (place,), row = self.indices([key]), self.size_of(key).start
        return math.expm1(self.landmarks.sizes[place]), math.sqrt(self.P[row, row])

    def indices(self, keys: Sequence[str]) -> Indices:
        """(K,) indices of landmarks among the active ones."""
        place = {key: number for number, key in enumerate(self.keys)}
        return np.array([place[key] for key in keys], np.intp)

    def rows_of(self, keys: Sequence[str]) -> Indices:
        """(7 K,) rows of landmarks in the covariance."""
        return rows_of(self.indices(keys))

    # the active landmarks

    def add(
        self, key: str, R: Floats, p: Floats, covariance: Floats, size_sigma: float = 0.0
    ) -> None:
        """Add a landmark with an independent covariance (6, 6) of its twist.

        ``size_sigma`` is the standard deviation of a tag's size, as a fraction.
        """
        self._make_room(PER_LANDMARK)
        new = LandmarkPoses([key], R[None], p[None], p[None], np.zeros(1))
        self.landmarks = self.landmarks.joined(new)
        rows, size = self.rows(key), self.size_of(key)
        self.joint[rows, rows], self.joint[size, size] = covariance, size_sigma**2

    def _make_room(self, count: int, memory: int = 0) -> None:
        """Zeros for further active errors, and for further errors at the division."""
        size, total = self.size, len(self.joint)
        joint = np.zeros((total + count + memory, total + count + memory))
        blocks = slice(size), slice(size, total)
        places = slice(size), slice(size + count, total + count)
        for rows, new_rows in zip(blocks, places, strict=True):
            for columns, new_columns in zip(blocks, places, strict=True):
                joint[new_rows, new_columns] = self.joint[rows, columns]
        self._set(joint)

    def share(self, rows: slice, by: Floats, of: slice = POSE) -> None:
        """Add ``by`` (k, m) times the error ``of`` other rows to independent ``rows``."""
        joint = self._own()
        across = by @ joint[of]
        joint[rows] += across
        joint[:, rows] += across.T
        joint[rows, rows] += across[:, of] @ by.T

    def forget(self, *blocks: slice) -> None:
        """Make errors zero and independent of all others."""
        joint = self._own()
        for rows in blocks:
            joint[rows], joint[:, rows] = 0, 0

    def inflate(self, rows: slice, covariance: Floats) -> None:
        """Add an independent error of that covariance."""
        self._own()[rows, rows] += covariance

    def with_prior(self, rows: slice, before: float, now: float) -> State:
        """The state as if the prior variance of sensors' states, of mean 0, had been larger.

        What was learnt with the former prior moves with it: robot, landmarks, all that is
        correlated. This takes back a measurement of 0: an update with negative noise.

        Args:
            rows: the states, constant meanwhile or slow.
            before, now: previous and present variance of their prior.
        """
        extra = 1 / (1 / before - 1 / now)
        values, axes = np.linalg.eigh(self.P[rows, rows])
        left = (axes / np.maximum(extra - values, extra - before)) @ axes.T
        own = self.robot.own[rows.start - core() :][: rows.stop - rows.start]
        across = self.joint[:, rows]
        error = across @ left @ own
        new = self.moved(error)
        new._set(self.joint + across @ left @ across.T)
        new.gradient = self.gradient + error[self.size :]
        return new

    def remove(self, *keys: str) -> None:
        """Remove landmarks, active or not."""
        if self.resting:
            self.resting = self.resting.without(keys)
        gone = self.indices([key for key in keys if key in self.keys])
        if not len(gone):
            return
        rows = np.delete(np.arange(len(self.joint)), rows_of(gone))
        self._set(self.joint[rows][:, rows])
        self.landmarks = self.landmarks.chosen(np.delete(np.arange(len(self.keys)), gone))

    # propagation and correction

    def propagate(self, robot: RobotState, J: Floats, noise: Floats) -> None:
        """Propagate the robot, its errors by J (core, core), and add noise of that covariance."""
        size = core()
        joint = self._own()
        joint[:size] = J @ joint[:size]
        joint[size:, :size] = joint[:size, size:].T
        joint[:size, :size] = joint[:size, :size] @ J.T + noise
        self.robot = robot
        if self.resting:
            self.resting.whole.settle()

    def age(self, keep: Floats, noise: Floats) -> None:
        """Let the robot's errors shrink by factors (core,), and add noise of variances (core,)."""
        size = core()
        joint = self._own()
        joint[:size] *= keep[:, None]
        joint[:, :size] *= keep
        joint[np.arange(size), np.arange(size)] += noise

    def moved(self, error: Floats) -> State:
        """The same, corrected by an error (n,), with unchanged covariance."""
        new = self.copy()
        new.robot = self.robot.moved(error[: core()])
        new.landmarks = self.landmarks.moved(error[core() : self.size])
        return new

    def corrected(
        self,
        columns: Indices | slice,
        H: Jacobian,
        innovation: Floats,
        noise: Floats,
        free: Mask | None = None,
    ) -> State:
        """The state corrected by a measurement of k numbers.

        Args:
            columns: the m rows that it depends on.
            H: (k, m) derivative of the expected values by these errors.
            innovation: (k,) measured minus expected.
            noise: (k, k) covariance.
            free: (n,) rows that are corrected; the others are considered: their errors count, but
                they are not estimated. None: all, and the resting landmarks too.

        Source: S. F. Schmidt, Application of state-space methods to navigation problems, 1966 (the
        considered states).
        """
        HP = H @ self.joint[columns]
        spread = H @ HP[:, columns].T + noise
        whitened = _whitened(spread, noise, np.column_stack([HP, innovation]))
        gain = whitened[:, :-1].T
        error = gain @ whitened[:, -1]
        if free is not None:
            rows = np.flatnonzero(free)
            less = gain[rows] @ gain.T
            return self.corrected_in(rows, error[rows], less, less[:, rows])
        new, less = self.moved(error), gain @ gain.T
        new._set(np.subtract(self.joint, less, out=less))
        new.gradient = self.gradient + error[self.size :]
        return new

    def corrected_in(self, rows: Indices, error: Floats, less: Floats, known: Floats) -> State:
        """The state with f rows corrected by any gain K; the others are considered.

        Args:
            rows: (f,) those.
            error: (f,) correction.
            less: (f, n + m) K times the derivative of the expected values, times the joint matrix.
            known: (f, f) covariance of the correction.

        Source: R. Bucy, P. Joseph, Filtering for Stochastic Processes, 1968 (any gain).
        """
        every = np.zeros(self.size)
        every[rows] = error
        new = self.moved(every)
        joint = new._own()
        block = joint[np.ix_(rows, rows)] + known - less[:, rows] - less[:, rows].T
        joint[rows] -= less
        joint[:, rows] = joint[rows].T
        joint[np.ix_(rows, rows)] = (block + block.T) / 2
        return new

    def seen_from(self, R: Floats, p: Floats) -> State:
        """The state in the frame of the GPS origin T_map_enu, (3, 3) and (3,), now exact."""
        new, size = self.whole(), core()
        back_R, back_p = R.T, -R.T @ p
        ahead = se3.adjoint(back_R, back_p)
        J = np.eye(size)
        for rows in (POSE, BEFORE):
            J[rows, rows] = ahead
            J[rows, DATUM] = -ahead[:, YAW]
        J[VELOCITY, VELOCITY] = back_R
        J[GRAVITY, GRAVITY] = back_R[:2, :2]
        J[DATUM] = 0

        def turned(P: Floats) -> Floats:
            several = P[size:].reshape(-1, PER_LANDMARK, P.shape[1])
            twists = ahead @ several[:, :TWIST] - ahead[:, YAW] @ P[DATUM]
            several = np.concatenate([twists, several[:, TWIST:]], axis=1)
            return np.concatenate([J @ P[:size], several.reshape(-1, P.shape[1])])

        new._set(turned(turned(new.joint).T))
        robot = new.robot
        new.robot = replace(
            robot,
            R=back_R @ robot.R,
            p=back_R @ robot.p + back_p,
            v=back_R @ robot.v,
            rates=back_R @ robot.rates,
            before_R=back_R @ robot.before_R,
            before_p=back_R @ robot.before_p + back_p,
            gravity=back_R @ robot.gravity,
            datum_R=np.eye(3),
            datum_p=np.zeros(3),
        )
        keys, landmarks_R, landmarks_p, first_p, sizes = new.landmarks
        landmarks_p, first_p = (one @ back_R.T + back_p for one in (landmarks_p, first_p))
        new.landmarks = LandmarkPoses(keys, back_R @ landmarks_R, landmarks_p, first_p, sizes)
        return new

    def with_robot_of(self, other: State) -> State:
        """The landmarks of this state, and the robot of another one without landmarks."""
        new, size = self.whole(), core()
        joint = new._own()
        joint[:size], joint[:, :size] = 0, 0
        joint[:size, :size] = other.P
        new.robot = other.robot
        return new

    # division

    def activate(self, keys: Iterable[str]) -> None:
        """Make resting landmarks active."""
        rest, size, total = self.resting, self.size, len(self.joint)
        keys = [key for key in dict.fromkeys(keys) if key not in self.keys]
        if rest is None or not keys:
            return
        landmarks, own, across = self._gained(rest, keys)
        count = len(own)
        lower = across.T @ self.joint[size:, size:]
        change = self.joint[:size, size:]
        covariance = rest.whole.covariance(own, own) + lower @ across
        self._make_room(count, count)
        joint, now, then = self.joint, slice(size, size + count), slice(size + count, total + count)
        joint[:size, now] = change @ across
        joint[now, :size] = joint[:size, now].T
        joint[now, now] = (covariance + covariance.T) / 2
        joint[now, then], joint[then, now] = lower, lower.T
        joint[now, total + count :] = joint[total + count :, now] = np.eye(count)
        self.gradient = np.concatenate([self.gradient, np.zeros(count)])
        self.landmarks = self.landmarks.joined(landmarks)
        self.resting = rest.activated(keys, own)

    def _gained(self, rest: Resting, keys: Sequence[str]) -> tuple[LandmarkPoses, Indices, Floats]:
        """Resting landmarks, as they are by now; their rows at the division, and the covariance
        (m, 7 K) of these with what they gain on.
        """
        places = rest.whole.places(keys)
        own = rows_of(places)
        across = rest.whole.covariance(own, rest.rows).T
        landmarks = rest.whole.landmarks.chosen(places).moved(across.T @ self.gradient)
        return landmarks, own, across

    def whole(self) -> State:
        """The state with all landmarks active."""
        new = self.copy()
        if new.resting:
            new.activate(new.resting.left)
            new.joint, new.gradient, new.resting = new.P, np.zeros(0), None
        return new

    def positions(self) -> dict[str, Floats]:
        """Positions (3,) of all landmarks; of resting ones, as they were."""
        whole = self.resting.whole.landmarks if self.resting else LandmarkPoses.none()
        found = dict(zip(whole.keys, whole.p, strict=True))
        return found | dict(zip(self.keys, self.landmarks_p, strict=True))

    def marginals(self, keys: Sequence[str]) -> tuple[Floats, Floats, Floats]:
        """Poses (K, 3, 3) and (K, 3) of any landmarks, and the covariances (K, 6, 6) of twists."""
        active = [key for key in keys if key in self.keys]
        found = self.landmarks.chosen(self.indices(active))
        blocks = [_blocks(self.P, self.rows_of(active))]
        others = [key for key in keys if key not in self.keys]
        for start in range(0, len(others), _AT_A_TIME):
            assert self.resting is not None
            gained, own, across = self._gained(self.resting, others[start : start + _AT_A_TIME])
            found = found.joined(gained)
            several = _blocks(self.resting.whole.covariance(own, own), np.arange(len(own)))
            one = across.T.reshape(-1, PER_LANDMARK, len(across))
            less = one @ self.joint[self.size :, self.size :]
            blocks.append(several + less @ np.swapaxes(one, 1, 2))
        place = {key: number for number, key in enumerate(found.keys)}
        order = np.array([place[key] for key in keys], np.intp)
        return found.R[order], found.p[order], np.concatenate(blocks)[order][:, :TWIST, :TWIST]

    @property
    def is_settled(self) -> bool:
        """True if a division costs little."""
        return self.resting is None or self.resting.whole.is_settled

    def divided(self, active: Collection[str]) -> State:
        """The same with these landmarks active alone."""
        rest, size = self.resting, self.size
        if rest:
            rest.whole.settle(len(rest.whole.keys) * PER_LANDMARK + core())
        self._is_shared = True
        whole = Whole(self.landmarks, self.joint, self.gradient, rest)
        places = np.array([n for n, key in enumerate(self.keys) if key in active], np.intp)
        robot, landmarks = np.arange(core()), rows_of(places)
        rows = np.concatenate([robot, landmarks])
        is_known = np.diag(self.joint)[:size][rows] > 0
        then, m = rows[is_known], int(is_known.sum())
        new = State(self.robot)
        new._set(np.zeros((len(rows) + m, len(rows) + m)))
        new.joint[: len(rows), : len(rows)] = self.joint[np.ix_(rows, rows)]
        across = np.eye(len(rows))[:, is_known]
        new.joint[: len(rows), len(rows) :], new.joint[len(rows) :, : len(rows)] = across, across.T
        new.gradient, new.landmarks = np.zeros(m), self.landmarks.chosen(places)
        new.resting = Resting(whole, tuple(new.keys), frozenset(), then)
        return new


def _whitened(spread: Floats, noise: Floats, values: Floats) -> Floats:
    """Values (k, m) divided by a root of a covariance, which is at least that of the noise."""
    try:
        root = np.linalg.cholesky(spread)
    except np.linalg.LinAlgError:  # by rounding
        squares, axes = np.linalg.eigh(spread)
        least = np.linalg.eigvalsh(noise)[0]
        divided: Floats = (axes / np.sqrt(np.maximum(squares, least))).T @ values
        return divided
    found = np.empty_like(values)
    for start in range(0, len(root), _ROWS_AT_A_TIME):  # forward substitution
        rows = slice(start, start + _ROWS_AT_A_TIME)
        left = values[rows] - root[rows, :start] @ found[:start]
        found[rows] = np.linalg.inv(root[rows, rows]) @ left
    return found


def _blocks(P: Floats, rows: Indices) -> Floats:
    """(K, 7, 7) the blocks of a covariance on its diagonal."""
    several = rows.reshape(-1, PER_LANDMARK)
    blocks: Floats = P[several[:, :, None], several[:, None, :]]
    return blocks

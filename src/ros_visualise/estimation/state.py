"""The filter's state: the robot and landmarks, with one covariance.

The first `core()` errors are the robot's own (`ros_visualise.estimation.robot`). Six follow for
each landmark; the last three stay zero if it has no orientation.

A correction costs the square of the number of landmarks. So a state of many landmarks is divided:
the *active* ones are corrected at once; what the others gain is summed up, and put in when the
state becomes whole again. No information is lost by that.

Source: J. Guivant, E. Nebot, Optimization of the simultaneous localization and map-building
algorithm for real-time implementation, 2001 (the division); A. Bryson, M. Frazier, Smoothing for
linear and nonlinear dynamic systems, 1963 (the sums).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
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

PER_LANDMARK = 6

Indices = npt.NDArray[np.intp]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Resting:
    """The landmarks that rest, and what they have gained.

    Attributes:
        whole: the state when it was divided.
        keys: the landmarks of ``whole`` that have been active since.
        dropped: those that were dropped since.
        change: (n, m) from errors of the robot and of ``keys`` in ``whole`` to today's active ones.
        information, gradient: (m, m) and (m,), gained on these errors in ``whole``.
    """

    whole: State
    keys: tuple[str, ...]
    dropped: frozenset[str]
    change: Floats
    information: Floats
    gradient: Floats

    @property
    def rows(self) -> Indices:
        """(m,) the rows of robot and ``keys`` in ``whole``."""
        return self.whole.rows_of(self.keys)

    @property
    def left(self) -> list[str]:
        """The landmarks that rest."""
        gone = self.dropped.union(self.keys)
        return [key for key in self.whole.keys if key not in gone]

    def corrected(
        self, gain: Floats, seen: Floats, weight: Floats, innovation: Floats, all_gain: bool
    ) -> Resting:
        """The same after a correction; the resting landmarks gain by it only if ``all_gain``."""
        change = self.change - gain @ seen
        if not all_gain:
            return replace(self, change=change)
        weighted = seen.T @ weight
        return replace(
            self,
            change=change,
            information=self.information + weighted @ seen,
            gradient=self.gradient + weighted @ innovation,
        )


@dataclass(eq=False)
class State:
    """The estimate at one time. Its methods change no array in place: a `copy` is independent.

    Attributes:
        robot: see `RobotState`.
        P: (n, n) covariance, n = core() + 6 for each active landmark.
        keys: names of the active landmarks' readings, in order.
        landmarks_R, landmarks_p: their poses, (L, 3, 3) and (L, 3).
        first_p: (L, 3) their first estimated positions.
        resting: the other landmarks, if any.
    """

    robot: RobotState = field(default_factory=RobotState)
    P: Floats = field(default_factory=lambda: np.zeros((core(), core())))
    keys: list[str] = field(default_factory=list)
    landmarks_R: Floats = field(default_factory=lambda: np.zeros((0, 3, 3)))
    landmarks_p: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    first_p: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    resting: Resting | None = None

    def copy(self) -> State:
        """An independent copy."""
        return copy(self)

    def rows(self, key: str) -> slice:
        """The rows of a landmark's errors in the covariance."""
        start = core() + PER_LANDMARK * self.keys.index(key)
        return slice(start, start + PER_LANDMARK)

    def indices(self, keys: Sequence[str]) -> Indices:
        """(K,) indices of landmarks among the active ones."""
        place = {key: number for number, key in enumerate(self.keys)}
        return np.array([place[key] for key in keys], np.intp)

    def rows_of(self, keys: Sequence[str], robot: int | None = None) -> Indices:
        """The first ``robot`` rows (all of its own by default), then those of landmarks."""
        starts = core() + PER_LANDMARK * self.indices(keys)
        landmarks = (starts[:, None] + np.arange(PER_LANDMARK)).ravel()
        return np.concatenate([np.arange(core() if robot is None else robot), landmarks])

    # the active landmarks

    def add(self, key: str, R: Floats, p: Floats, covariance: Floats) -> None:
        """Add a landmark with an independent covariance (6, 6) of its twist."""
        size = len(self.P)
        P = np.zeros((size + PER_LANDMARK, size + PER_LANDMARK))
        P[:size, :size], P[size:, size:] = self.P, covariance
        self.P = P
        self._append([key], R[None], p[None], p[None])
        if self.resting:
            more = np.zeros((PER_LANDMARK, self.resting.change.shape[1]))
            self.resting = replace(self.resting, change=np.vstack([self.resting.change, more]))

    def _append(self, keys: Iterable[str], R: Floats, p: Floats, first_p: Floats) -> None:
        self.keys = [*self.keys, *keys]
        self.landmarks_R = np.concatenate([self.landmarks_R, R])
        self.landmarks_p = np.concatenate([self.landmarks_p, p])
        self.first_p = np.concatenate([self.first_p, first_p])

    def share(self, rows: slice, by: Floats, of: slice = POSE) -> None:
        """Add ``by`` (k, m) times the error ``of`` other rows to independent ``rows``."""
        P = self.P.copy()
        across = by @ P[of]
        P[rows] += across
        P[:, rows] += across.T
        P[rows, rows] += across[:, of] @ by.T
        self.P = P
        if self.resting:
            change = self.resting.change.copy()
            change[rows] += by @ change[of]
            self.resting = replace(self.resting, change=change)

    def forget(self, *blocks: slice) -> None:
        """Make errors zero and independent of all others."""
        P = self.P.copy()
        for rows in blocks:
            P[rows], P[:, rows] = 0, 0
        self.P = P
        if self.resting:
            change = self.resting.change.copy()
            for rows in blocks:
                change[rows] = 0
            self.resting = replace(self.resting, change=change)

    def inflate(self, rows: slice, covariance: Floats) -> None:
        """Add an independent error of that covariance."""
        P = self.P.copy()
        P[rows, rows] += covariance
        self.P = P

    def remove(self, key: str) -> None:
        """Remove a landmark, active or not."""
        rest = self.resting
        if rest and key in rest.whole.keys:
            rest = self.resting = replace(rest, dropped=rest.dropped | {key})
        if key not in self.keys:
            return
        number, kept = self.keys.index(key), np.delete(np.arange(len(self.P)), self.rows(key))
        self.P = self.P[np.ix_(kept, kept)]
        self.keys = self.keys[:number] + self.keys[number + 1 :]
        self.landmarks_R = np.delete(self.landmarks_R, number, axis=0)
        self.landmarks_p = np.delete(self.landmarks_p, number, axis=0)
        self.first_p = np.delete(self.first_p, number, axis=0)
        if rest:
            self.resting = replace(rest, change=rest.change[kept])

    # propagation and correction

    def propagate(self, robot: RobotState, J: Floats, noise: Floats) -> None:
        """Propagate the robot, its errors by J (core, core), and add noise of that covariance."""
        size = core()
        P = self.P.copy()
        P[:size, :size] = J @ P[:size, :size] @ J.T + noise
        P[:size, size:] = J @ P[:size, size:]
        P[size:, :size] = P[:size, size:].T
        self.robot, self.P = robot, P
        if self.resting:
            change = self.resting.change.copy()
            change[:size] = J @ change[:size]
            self.resting = replace(self.resting, change=change)

    def age(self, keep: Floats, noise: Floats) -> None:
        """Let the robot's errors shrink by factors (core,), and add noise of variances (core,)."""
        size = core()
        P = self.P.copy()
        P[:size] *= keep[:, None]
        P[:, :size] *= keep
        P[np.arange(size), np.arange(size)] += noise
        self.P = P
        if self.resting:
            change = self.resting.change.copy()
            change[:size] *= keep[:, None]
            self.resting = replace(self.resting, change=change)

    def moved(self, error: Floats) -> State:
        """The same, corrected by an error (n,), with unchanged covariance."""
        new = copy(self)
        new.robot = self.robot.moved(error[: core()])
        if self.keys:
            twists = error[core() :].reshape(-1, PER_LANDMARK)
            new.landmarks_R, new.landmarks_p = se3.moved(twists, self.landmarks_R, self.landmarks_p)
        return new

    def corrected(
        self,
        columns: Indices | slice,
        H: Floats,
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
        PH = self.P[:, columns] @ H.T
        weight = np.linalg.inv(H @ PH[columns] + noise)
        gain = PH @ weight
        less = gain @ PH.T
        if free is not None:
            fixed = ~free
            gain[fixed] = 0
            less[np.ix_(fixed, fixed)] = 0
        new = self.moved(gain @ innovation)
        P = self.P - less
        new.P = (P + P.T) / 2
        if self.resting:
            seen = H @ self.resting.change[columns]
            new.resting = self.resting.corrected(gain, seen, weight, innovation, free is None)
        return new

    def seen_from(self, R: Floats, p: Floats) -> State:
        """The state in the frame of the GPS origin T_map_enu, (3, 3) and (3,), now exact."""
        new, size = self.whole(), core()
        back_R, back_p = R.T, -R.T @ p
        ahead = se3.adjoint(back_R, back_p)
        J = np.eye(len(new.P))
        for rows in (POSE, BEFORE, *(slice(n, n + 6) for n in range(size, len(new.P), 6))):
            J[rows, rows] = ahead
            J[rows, DATUM] = -ahead[:, YAW]
        J[VELOCITY, VELOCITY] = back_R
        J[GRAVITY, GRAVITY] = back_R[:2, :2]
        J[DATUM] = 0
        new.P = J @ new.P @ J.T
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
        new.landmarks_R = back_R @ new.landmarks_R
        new.landmarks_p = new.landmarks_p @ back_R.T + back_p
        new.first_p = new.first_p @ back_R.T + back_p
        return new

    def with_robot_of(self, other: State) -> State:
        """The landmarks of this state, and the robot of another one without landmarks."""
        new, size = self.whole(), core()
        P = new.P.copy()
        P[:size], P[:, :size] = 0, 0
        P[:size, :size] = other.P
        new.robot, new.P = other.robot, P
        return new

    # division

    def activate(self, keys: Iterable[str]) -> None:
        """Make resting landmarks active."""
        rest, size = self.resting, len(self.P)
        keys = [key for key in keys if key not in self.keys]
        if rest is None or not keys:
            return
        lower = self._join(rest, keys)
        count, m = len(lower), rest.change.shape[1]
        change, information = np.zeros((size + count, m + count)), np.zeros((m + count, m + count))
        change[:size, :m], change[size:, :m] = rest.change, lower
        change[size:, m:] = np.eye(count)
        information[:m, :m] = rest.information
        gradient = np.concatenate([rest.gradient, np.zeros(count)])
        known = (*rest.keys, *keys)
        self.resting = replace(
            rest, keys=known, change=change, information=information, gradient=gradient
        )

    def _join(self, rest: Resting, keys: Sequence[str]) -> Floats:
        """Add resting landmarks, as they are by now; (6 k, m) from errors in ``whole`` to these."""
        whole, size = rest.whole, len(self.P)
        own = whole.rows_of(keys, robot=0)
        across = whole.P[np.ix_(rest.rows, own)]
        lower: Floats = -across.T @ rest.information
        P = np.empty((size + len(own), size + len(own)))
        P[:size, :size], P[:size, size:] = self.P, rest.change @ across
        P[size:, :size] = P[:size, size:].T
        P[size:, size:] = whole.P[np.ix_(own, own)] + lower @ across
        self.P = P
        first_p = whole.first_p[whole.indices(keys)]
        self._append(keys, *self._gained(whole, keys, across.T @ rest.gradient), first_p)
        return lower

    def whole(self) -> State:
        """The state with all landmarks active."""
        new = copy(self)
        if new.resting and new.resting.left:
            new._join(new.resting, new.resting.left)
        new.resting = None
        return new

    def positions(self) -> dict[str, Floats]:
        """Positions (3,) of all landmarks; of resting ones, as they were."""
        rest = self.resting
        found = dict(zip(rest.whole.keys, rest.whole.landmarks_p, strict=True)) if rest else {}
        return found | dict(zip(self.keys, self.landmarks_p, strict=True))

    def marginals(self, keys: Sequence[str]) -> tuple[Floats, Floats, Floats]:
        """Poses (K, 3, 3) and (K, 3) of any landmarks, and the covariances (K, 6, 6) of twists."""
        active = [key for key in keys if key in self.keys]
        places, blocks = self.indices(active), self._blocks(self.P, self.rows_of(active, robot=0))
        found = self.landmarks_R[places], self.landmarks_p[places], blocks
        rest = self.resting
        others = [key for key in keys if key not in self.keys]
        if rest is None or not others:
            return found
        whole, own = rest.whole, rest.whole.rows_of(others, robot=0)
        across = whole.P[np.ix_(rest.rows, own)]
        R, p = self._gained(whole, others, across.T @ rest.gradient)
        gained = np.split(rest.information @ across, len(others), axis=1)
        several = zip(np.split(across, len(others), axis=1), gained, strict=True)
        lower = np.array([one.T @ more for one, more in several])
        every = [*zip(active, *found, strict=True)]
        every += zip(others, R, p, self._blocks(whole.P, own) - lower, strict=True)
        by_key = {key: values for key, *values in every}
        columns = zip(*(by_key[key] for key in keys), strict=True)
        R, p, blocks = (np.array(column) for column in columns)
        return R, p, blocks

    @staticmethod
    def _blocks(P: Floats, rows: Indices) -> Floats:
        """(K, 6, 6) the blocks of a covariance on its diagonal."""
        several = rows.reshape(-1, PER_LANDMARK)
        blocks: Floats = P[several[:, :, None], several[:, None, :]]
        return blocks

    @staticmethod
    def _gained(whole: State, keys: Sequence[str], error: Floats) -> tuple[Floats, Floats]:
        """Poses of landmarks, corrected by their errors (6 K,)."""
        places = whole.indices(keys)
        twists = error.reshape(-1, PER_LANDMARK)
        return se3.moved(twists, whole.landmarks_R[places], whole.landmarks_p[places])

    def divided(self, active: Collection[str]) -> State:
        """The same with these landmarks active alone."""
        whole = self.whole()
        keys = [key for key in whole.keys if key in active]
        rows, places = whole.rows_of(keys), whole.indices(keys)
        m = len(rows)
        rest = Resting(whole, tuple(keys), frozenset(), np.eye(m), np.zeros((m, m)), np.zeros(m))
        return State(
            whole.robot,
            whole.P[np.ix_(rows, rows)],
            keys,
            whole.landmarks_R[places],
            whole.landmarks_p[places],
            whole.first_p[places],
            rest,
        )

"""A divided state equals a filter that always corrects everything, written out here in full."""

from __future__ import annotations

import numpy as np
import pytest

from ros_visualise.estimation.robot import RobotState, core
from ros_visualise.estimation.state import State

ROBOT = 6  # of its errors are known in the beginning


class Dense:
    """The textbook's filter over robot and points: linear, with one dense covariance."""

    def __init__(self, P):
        self.P, self.x, self.keys = P, np.zeros(len(P)), []

    def copy(self):
        new = Dense(self.P.copy())
        new.x, new.keys = self.x.copy(), list(self.keys)
        return new

    def rows(self, key):
        return slice(core() + 6 * self.keys.index(key), core() + 6 * self.keys.index(key) + 6)

    def add(self, key, p, covariance):
        n = len(self.P)
        P = np.zeros((n + 6, n + 6))
        P[:n, :n], P[n:, n:] = self.P, covariance
        self.P, self.x = P, np.concatenate([self.x, p, np.zeros(3)])
        self.keys.append(key)

    def apply(self, J, Q):
        """J and Q are of the first errors alone."""
        every, noise = np.eye(len(self.P)), np.zeros_like(self.P)
        every[: len(J), : len(J)], noise[: len(J), : len(J)] = J, Q
        self.P = every @ self.P @ every.T + noise

    def remove(self, key):
        kept = np.delete(np.arange(len(self.P)), self.rows(key))
        self.P, self.x = self.P[np.ix_(kept, kept)], self.x[kept]
        self.keys.remove(key)

    def correct(self, H, z, R, free=None):
        S = H @ self.P @ H.T + R
        K = self.P @ H.T @ np.linalg.inv(S)
        if free is not None:
            K[~free] = 0
        self.x = self.x + K @ z
        IKH = np.eye(len(self.P)) - K @ H
        self.P = IKH @ self.P @ IKH.T + K @ R @ K.T  # Joseph's form, true for any gain


def begun():
    P = np.zeros((core(), core()))
    P[:ROBOT, :ROBOT] = np.diag([0.1, 0.2, 0.3, 0, 0, 0])
    return State(RobotState(), P.copy()), Dense(P)


def flown(seed, steps, divide):
    """Both filters after the same random events; a divided state that rests now and then."""
    random = np.random.default_rng(seed)
    state, dense = begun()
    copies = []
    for number in range(steps):
        state = state.copy()
        kind = random.choice(["add", "move", "see", "see", "watch", "remove", "back"])
        active = sorted(state.keys)
        if kind == "add" or len(dense.keys) < 3:
            key, p, covariance = f"{number}", random.normal(size=3), np.zeros((6, 6))
            covariance[:3, :3] = np.diag(random.uniform(0.01, 0.1, 3))
            state.add(key, np.eye(3), p, covariance)
            state.share(state.rows(key), np.eye(6))
            dense.add(key, p, covariance)
            J = np.eye(len(dense.P))
            J[dense.rows(key), :6] += np.eye(6)
            dense.apply(J, np.zeros_like(J))
        elif kind == "move":
            J, Q = np.eye(core()), np.zeros((core(), core()))
            J[:3, :3] += random.normal(0, 0.1, (3, 3))
            Q[:3, :3] = np.diag(random.uniform(0, 0.01, 3))
            state.propagate(state.robot, J, Q)
            dense.apply(J, Q)
        elif kind in ("see", "watch") and active:
            keys = list(random.choice(active, min(len(active), 3), replace=False))
            mine = np.concatenate([np.arange(3), *(state.rows_of([one])[:3] for one in keys)])
            theirs = [np.arange(3), *(np.arange(len(dense.P))[dense.rows(k)][:3] for k in keys)]
            H = random.normal(size=(4, len(mine)))
            z, R = random.normal(0, 0.1, 4), np.diag(random.uniform(0.01, 0.1, 4))
            every = np.zeros((4, len(dense.P)))
            every[:, np.concatenate(theirs)] = H
            free = their_free = None
            if kind == "watch":
                free, their_free = np.zeros(len(state.P), bool), np.zeros(len(dense.P), bool)
                free[state.rows(keys[0])] = their_free[dense.rows(keys[0])] = True
            state = state.corrected(mine, H, z, R, free)
            dense.correct(every, z, R, their_free)
        elif kind == "remove" and len(dense.keys) > 8 and random.random() < 0.3:
            key = str(random.choice(dense.keys))
            state.remove(key)
            dense.remove(key)
        elif kind == "back":
            state.activate(random.choice(dense.keys, 2))
        if divide and number % divide == divide - 1:
            state = state.divided(set(random.choice(sorted(state.keys), 3)))
        if number % 50 == 20:
            copies.append((state, dense.copy()))
    return [*copies, (state, dense)]


def twist_of(state, key):
    return np.arange(len(state.joint))[state.rows(key)]


def assert_same(state, dense):
    whole = state.whole()
    order = np.concatenate([np.arange(core()), *(twist_of(whole, key) for key in dense.keys)])
    assert whole.P[np.ix_(order, order)] == pytest.approx(dense.P, rel=1e-7, abs=1e-10)
    assert whole.robot.p == pytest.approx(dense.x[:3], abs=1e-8)
    expected = dense.x[core() :].reshape(-1, 6)[:, :3]
    assert whole.landmarks_p[whole.indices(dense.keys)] == pytest.approx(expected, abs=1e-8)
    _, p, blocks = state.marginals(dense.keys)
    assert p == pytest.approx(expected, abs=1e-8)
    for key, block in zip(dense.keys, blocks, strict=True):
        assert block == pytest.approx(dense.P[dense.rows(key), dense.rows(key)], abs=1e-9)


@pytest.mark.parametrize("divide", [0, 7, 40])
@pytest.mark.parametrize("seed", range(3))
def test_resting_landmarks_lose_nothing(seed, divide):
    """Also what rests is put together piece by piece, and older copies stay as they were."""
    for state, dense in flown(seed, 150, divide):
        assert_same(state, dense)


def test_a_state_of_many_landmarks_is_put_together_as_the_robot_moves():
    state, _ = flown(5, 250, 40)[-1]
    state = state.divided(set(state.keys[:3]))
    assert not state.is_settled
    for _ in range(50):
        state.propagate(state.robot, np.eye(core()), np.zeros((core(), core())))
    assert state.is_settled

"""A way that is corrected where it comes back to places that were seen before.

Between two keyframes the odometry errs a little, in pose and in scale, independently of all other
keyframes; a closure measures the sum of these errors around a loop. So only as many unknowns as
there are closures have to be solved for. Closures that the odometry contradicts, by its own
covariance, are rejected; others count the less the worse they fit.

With edges ``E_i exp(n_i)`` of covariance ``q_i``, and ``r = log(S^-1 G_a^-1 G_b)`` around a loop,

    n = q J' (J q J' + W)^-1 (J n - r),   J_i = Ad(G_b^-1 G_i)  for a < i <= b,

is repeated (Gauss-Newton, as its dual problem).

Source: H. Strasdat, J. Montiel, A. Davison, Scale drift-aware large scale monocular SLAM, RSS 2010;
N. Sunderhauf, P. Protzel, Switchable constraints for robust pose graph SLAM, IROS 2012 (why).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.visual.revisits import Closure
from ros_visualise.estimation.visual.views import SeenPlace
from ros_visualise.geometry import se3, similarity
from ros_visualise.geometry.similarity import Similarity

_STEPS = 10
_DONE = 1e-6
_GATE = 2 * 24.3  # chi squared of 7 numbers at 0.1%; twice, as the odometry is a little too sure
_LOOSE = 3.0  # standard deviations beyond which a closure counts less
_LEAST = 0.01, 5e-4, 2e-3  # standard deviations of an edge: of its length, rad, log scale
_UNKNOWN = 2.0  # standard deviation of the rotation and of the scale between two maps
_LOST = 3.0  # that of the position, in lengths of all of the way
_MOST = 100  # closures
_TOGETHER = 5  # keyframes before and after one whose closures err alike, by the same points


class ClosedWay(NamedTuple):
    """A corrected way.

    Attributes:
        poses: similarities T_map_camera of the keyframes; the scale of a map without metres varies.
        covariances: (N, 7, 7) of their twists in the map.
        used: the closures that count.
        rejected: those that the odometry contradicts.
    """

    poses: list[Similarity]
    covariances: Floats
    used: list[Closure]
    rejected: list[Closure]


def edge_errors(places: Sequence[SeenPlace], covariances: Floats) -> Floats:
    """(N, 7, 7) covariances of the edges, such that they add up to what the odometry says.

    The first is of the first keyframe, whose error no closure changes.

    Args:
        places: the keyframes.
        covariances: (N, 6, 6) of the odometry's poses, of twists in the map.
    """
    q = np.zeros((len(places), 7, 7))
    positions = np.array([one.p for one in places])
    parts = np.array([one.stretch for one in places])
    back = se3.adjoint(places[0].R.T, -places[0].R.T @ places[0].p)
    q[0, :6, :6] = back @ _least(covariances, positions) @ back.T
    for part in np.unique(parts):
        (at,) = np.nonzero(parts == part)
        first, last = at[0], at[-1]
        own = covariances[last] - (covariances[first] if first else 0)
        steps = np.linalg.norm(np.diff(positions[at], axis=0), axis=1)
        change = se3.about_itself(positions[last])
        own = np.diag(change @ own @ change.T)
        turning = max(own[3:].mean() / max(len(steps), 1), _LEAST[1] ** 2)
        lever = float(((positions[last] - positions[at[1:]]) ** 2).sum())
        scale = max(own[:3].sum() / max(lever, 1e-12), _LEAST[2] ** 2)
        for n, step in zip(at[1:], steps, strict=True):
            place = (_LEAST[0] * step) ** 2 + 1e-12
            q[n] = np.diag([*[place] * 3, *[turning] * 3, scale])
        if first:
            far = _LOST * max(float(np.ptp(positions, axis=0).max()), 1e-3)
            q[first] = np.diag([*[far**2] * 3, *[_UNKNOWN**2] * 4])
    return q


def _least(covariances: Floats, positions: Floats) -> Floats:
    """The covariance (6, 6) of the best-known pose, which includes that of the first pose.

    The first pose's own covariance is older than the views that showed the scale.
    """
    changes = [se3.about_itself(p) for p in positions]
    spread = [np.trace((A @ P @ A.T)[:3, :3]) for A, P in zip(changes, covariances, strict=True)]
    least: Floats = covariances[int(np.argmin(spread))]
    return least


def close_way(places: Sequence[SeenPlace], q: Floats, closures: Sequence[Closure]) -> ClosedWay:
    """Correct a way by closures; see the module."""
    start = [Similarity(1.0, one.R, one.p) for one in places]
    edges = [start[0], *(similarity.product(similarity.inverse(a), b)
                         for a, b in pairwise(start))]  # fmt: skip
    every = max(len(closures) // _MOST, 1)
    used, rejected = _gated(start, q, closures[::every])
    n, poses, weights = np.zeros((len(places), 7)), start, _shares(used)
    for _ in range(_STEPS if used else 0):
        loops = _Loops(poses, q, used)
        solved = np.linalg.solve(loops.M + loops.spread(weights), loops.around(n) - loops.r)
        new = loops.back(solved)
        change, n = float(np.abs(new - n).max()), new
        poses = _followed(edges, n)
        weights = _weights(poses, used)
        if change < _DONE:
            break
    loops = _Loops(poses, q, used)
    return ClosedWay(poses, loops.covariances(weights), used, rejected)


class _Loops:
    """The loops of a way: their residuals ``r`` (7 L,), and ``M`` = J q J' (7 L, 7 L).

    In the frame of the map the errors of edges are added up, so sums over loops are differences of
    sums from the start.
    """

    def __init__(self, poses: Sequence[Similarity], q: Floats, closures: Sequence[Closure]) -> None:
        self._q, self._closures = q, closures
        self._ad = np.array([similarity.adjoint(one) for one in poses])
        steps = self._ad @ q @ np.swapaxes(self._ad, 1, 2)
        self._sums: Floats = np.cumsum(steps, axis=0)
        self._first = np.array([one.first for one in closures], int)
        self._last = np.array([one.second for one in closures], int)
        self._to_last = np.array(
            [similarity.adjoint(similarity.inverse(poses[one.second])) for one in closures]
        ).reshape(-1, 7, 7)
        self.r = np.array([_residual(poses, one) for one in closures]).ravel()
        low = np.maximum(self._first[:, None], self._first)
        high = np.maximum(np.minimum(self._last[:, None], self._last), low)
        common = self._sums[high] - self._sums[low]
        M = self._to_last[:, None] @ common @ np.swapaxes(self._to_last, 1, 2)[None]
        self.M: Floats = M.transpose(0, 2, 1, 3).reshape(len(self.r), len(self.r))

    def spread(self, weights: Floats) -> Floats:
        """The covariances of the closures (7 L, 7 L), where each has a weight."""
        W = np.zeros_like(self.M)
        for k, one in enumerate(self._closures):
            W[7 * k : 7 * k + 7, 7 * k : 7 * k + 7] = one.covariance / weights[k]
        return W

    def around(self, n: Floats) -> Floats:
        """J n."""
        sums = np.cumsum((self._ad @ n[..., None])[..., 0], axis=0)
        way = sums[self._last] - sums[self._first]
        return np.asarray((self._to_last @ way[..., None])[..., 0].ravel())

    def back(self, y: Floats) -> Floats:
        """q J' y, (N, 7)."""
        one = (np.swapaxes(self._to_last, 1, 2) @ y.reshape(-1, 7, 1))[..., 0]
        sums = np.zeros((len(self._q) + 1, 7))
        np.add.at(sums, self._first + 1, one)
        np.add.at(sums, self._last + 1, -one)
        inside = np.cumsum(sums[:-1], axis=0)[..., None]
        return np.asarray((self._q @ np.swapaxes(self._ad, 1, 2) @ inside)[..., 0])

    def covariances(self, weights: Floats) -> Floats:
        """(N, 7, 7) of the poses, of twists in the map."""
        P: Floats = self._sums.copy()
        if not self._closures:
            return P
        inverse = np.linalg.inv(self.M + self.spread(weights))
        to_last = np.swapaxes(self._to_last, 1, 2)
        for k in range(len(P)):
            low, high = np.minimum(k, self._first), np.minimum(k, self._last)
            H = (self._sums[high] - self._sums[low]) @ to_last
            H = H.transpose(1, 0, 2).reshape(7, -1)
            P[k] -= H @ inverse @ H.T
        return P


def _followed(edges: Sequence[Similarity], n: Floats) -> list[Similarity]:
    poses = [edges[0]]
    for edge, error in zip(edges[1:], n[1:], strict=True):
        step = similarity.product(edge, similarity.exp(error))
        poses.append(similarity.product(poses[-1], step))
    return poses


def _residual(poses: Sequence[Similarity], one: Closure) -> Floats:
    way = similarity.product(similarity.inverse(poses[one.first]), poses[one.second])
    return similarity.log(similarity.product(similarity.inverse(one.motion), way))


def _gated(
    poses: Sequence[Similarity], q: Floats, closures: Sequence[Closure]
) -> tuple[list[Closure], list[Closure]]:
    """Closures that the odometry allows, and the others."""
    used: list[Closure] = []
    rejected: list[Closure] = []
    for one in closures:
        loop = _Loops(poses, q, [one])
        off = float(loop.r @ np.linalg.solve(loop.M + one.covariance, loop.r))
        (used if off < _GATE else rejected).append(one)
    return used, rejected


def _shares(closures: Sequence[Closure]) -> Floats:
    """(L,) weights by which closures of neighbouring keyframes count as one."""
    at = np.array([one.second for one in closures], int)
    shares: Floats = 1.0 / (np.abs(at[:, None] - at) <= _TOGETHER).sum(axis=1)
    return shares


def _weights(poses: Sequence[Similarity], closures: Sequence[Closure]) -> Floats:
    """(L,) the same, where by Cauchy's rule those that do not fit count less."""
    squares = []
    for one in closures:
        r = _residual(poses, one)
        squares.append(float(r @ np.linalg.solve(one.covariance, r)))
    return _shares(closures) / (1 + np.array(squares) / _LOOSE**2)

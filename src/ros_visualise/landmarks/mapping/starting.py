"""Initial poses: from one pose to the next, along the most certain links."""

from __future__ import annotations

import heapq
from collections import defaultdict
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.geometry import rotations
from ros_visualise.geometry.se3 import from_parts, inverse
from ros_visualise.landmarks.mapping.problem import Flags, Poses, Problem

Node = tuple[str, int]
"""A view or a tag, and its index."""

_ARM_M = 2.0  # lever arm that converts rotation variance to position variance
_DRIFT = 0.05  # assumed error of odometry, per distance


class InitialPoses(NamedTuple):
    """Initial poses, and masks of those that have one.

    Attributes:
        T_views, T_tags: (N, 4, 4) and (M, 4, 4) in the map.
        views, tags: (N,) and (M,) True if connected with the start.
    """

    T_views: Floats
    T_tags: Floats
    views: Flags
    tags: Flags


class _Tie(NamedTuple):
    to: Node
    variance: float
    T: Floats
    """Pose of the other in this one's frame."""


def begin(problem: Problem) -> InitialPoses:
    """Poses of all that is connected with the start, or with the survey.

    The map's frame is the fixed frame of tf if there is odometry, else that of the tag
    ``problem.anchor``. With a survey, each group of tags is moved to fit it.

    Source: E. Dijkstra, A note on two problems in connexion with graphs, 1959; the lengths are
    variances, which add up along a path.
    """
    ties = _ties(problem)
    if problem.surveyed:
        found: dict[Node, Floats] = {}
        for number in range(len(problem.names)):
            if ("tag", number) not in found:
                group = _spread(ties, ("tag", number), np.eye(4))
                T = _to_survey(group, problem)
                found |= {node: T @ one for node, one in group.items()} if T is not None else {}
    elif problem.odometry is not None:
        found = _spread(ties, ("view", 0), problem.odometry.T_fixed_camera[0])
    else:
        found = _spread(ties, ("tag", problem.anchor), np.eye(4))
    return _collected(problem, found)


def anchor_of(problem: Problem) -> int:
    """The most frequent tag of the largest group of tags seen together."""
    ties = _ties(problem)
    left, largest = set(range(len(problem.names))), set[int]()
    while left:
        group = {n for kind, n in _spread(ties, ("tag", min(left)), np.eye(4)) if kind == "tag"}
        left -= group
        largest = max(largest, group, key=len)
    return max(sorted(largest), key=lambda number: len(ties["tag", number]))


def _to_survey(group: dict[Node, Floats], problem: Problem) -> Floats | None:
    """(4, 4) that moves a group to its surveyed place; None if undetermined.

    Source: K. Arun, T. Huang, S. Blostein, Least-Squares Fitting of Two 3-D Point Sets, 1987.
    """
    known = [one for one in problem.surveyed if ("tag", one.tag) in group]
    for one in known:
        if one.R is not None and len(known) < 3:
            return from_parts(one.R, one.position_xyz) @ inverse(group["tag", one.tag])
    if len(known) < 3:
        return None
    here = np.array([group["tag", one.tag][:3, 3] for one in known])
    there = np.array([one.position_xyz for one in known])
    middle, wanted = here.mean(axis=0), there.mean(axis=0)
    U, _, Vt = np.linalg.svd((there - wanted).T @ (here - middle))
    R = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    return from_parts(R, wanted - R @ middle)


def poses(T: Floats) -> Poses:
    """(N, 4, 4) transforms as poses."""
    return Poses(T[:, :3, :3].copy(), T[:, :3, 3].copy())


def _ties(problem: Problem) -> dict[Node, list[_Tie]]:
    ties: dict[Node, list[_Tie]] = defaultdict(list)

    def tie(a: Node, b: Node, variance: float, T: Floats) -> None:
        ties[a].append(_Tie(b, variance, T))
        ties[b].append(_Tie(a, variance, inverse(T)))

    for one in problem.sightings:
        best = one.hypotheses[0]
        T = from_parts(rotations.to_matrix(best.quat_xyzw), best.position_xyz)
        variances = np.diag(best.covariance)
        variance = float(variances[:3].sum() + _ARM_M**2 * variances[3:].sum())
        share = best.score / sum(other.score for other in one.hypotheses)
        tie(("view", one.view), ("tag", one.tag), variance / max(share, 1e-3), T)
    if problem.odometry is not None:
        T_fixed = problem.odometry.T_fixed_camera
        steps = inverse(T_fixed[:-1]) @ T_fixed[1:]
        ways = np.linalg.norm(steps[:, :3, 3], axis=1)
        for view, (T, way) in enumerate(zip(steps, ways, strict=True)):
            tie(("view", view), ("view", view + 1), float((_DRIFT * way) ** 2 + 1e-6), T)
    return ties


def _spread(ties: dict[Node, list[_Tie]], start: Node, T: Floats) -> dict[Node, Floats]:
    """T_map_node of all reachable nodes."""
    found: dict[Node, Floats] = {}
    waiting = [(0.0, 0, start, T)]
    count = 0
    while waiting:
        variance, _, node, T = heapq.heappop(waiting)
        if node in found:
            continue
        found[node] = T
        for one in ties[node]:
            if one.to not in found:
                count += 1
                heapq.heappush(waiting, (variance + one.variance, count, one.to, T @ one.T))
    return found


def _collected(problem: Problem, found: dict[Node, Floats]) -> InitialPoses:
    views, tags = problem.counts
    of_views = [found.get(("view", number)) for number in range(views)]
    of_tags = [found.get(("tag", number)) for number in range(tags)]
    return InitialPoses(
        np.array([np.eye(4) if T is None else T for T in of_views]).reshape(-1, 4, 4),
        np.array([np.eye(4) if T is None else T for T in of_tags]).reshape(-1, 4, 4),
        np.array([T is not None for T in of_views], bool),
        np.array([T is not None for T in of_tags], bool),
    )

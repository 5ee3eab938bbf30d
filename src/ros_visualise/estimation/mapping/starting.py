"""Initial poses: from one pose to the next, along the most certain links.

Views and tags are nodes, linked by sightings, by odometry, and by the survey. Errors of poses are
twists of the map (`ros_visualise.geometry.se3`), so covariances add up along a path, and the poses
of two nodes differ by the covariances between them and the node where their paths part. Each link
that is not part of the tree closes a loop, and is thus a test of all that the loop contains.
"""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.mapping.problem import Flags, Poses, Problem
from ros_visualise.geometry import rotations
from ros_visualise.geometry.se3 import about_origin, adjoint, from_parts, inverse, log

Node = tuple[str, int]
"""A view or a tag, and its index."""
MAP: Node = ("map", 0)
"""The frame of a survey."""

_ARM_M = 2.0  # lever arm that converts rotation variance to position variance
_DRIFT = 0.05, 0.02  # assumed error of odometry: per distance, and in radians
_TRIPLES = 200  # of surveyed positions that are tried


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


class PoseLink(NamedTuple):
    """Two nodes, the possible poses (H, 4, 4) of the second in the first, the likeliest first.

    Attributes:
        covariance: (6, 6) of the twist, in the frame of the first.
        variance: one number, for the choice of paths.
    """

    first: Node
    second: Node
    T: Floats
    covariance: Floats
    variance: float


_Waiting = tuple[float, int, Node, Floats, Node | None, PoseLink | None]


@dataclass(eq=False)
class PoseTree:
    """Poses of nodes, the covariances of their twists, and the nodes that they hang by."""

    T: dict[Node, Floats] = field(default_factory=dict)
    covariance: dict[Node, Floats] = field(default_factory=dict)
    parent: dict[Node, Node | None] = field(default_factory=dict)

    def loop(self, a: Node, b: Node) -> tuple[list[Node], Floats]:
        """The nodes on the path between two nodes, and its covariance."""
        above = [*self._up(a)]
        place = {node: number for number, node in enumerate(above)}
        path = []
        for node in self._up(b):
            path.append(node)
            if node in place:
                break
        joint = self.covariance[a] + self.covariance[b] - 2 * self.covariance[path[-1]]
        return above[: place[path[-1]]] + path, joint

    def _up(self, node: Node | None) -> Iterator[Node]:
        while node is not None:
            yield node
            node = self.parent[node]


def begin(problem: Problem) -> InitialPoses:
    """Poses of all that is connected with the start, or with the survey.

    The map's frame is that of the survey, else the fixed frame of tf if there is odometry, else
    that of the tag ``problem.anchor``. Groups of tags with surveyed positions only are moved to fit
    these.
    """
    links = links_of(problem)
    if not problem.surveyed:
        return _collected(problem, spread(links, *root_of(problem)).T)
    found = spread(links, MAP).T
    for number in range(len(problem.names)):
        if ("tag", number) not in found:
            group = spread(links, ("tag", number)).T
            T = to_survey(group, problem)
            found |= {node: T @ one for node, one in group.items()} if T is not None else {}
    return _collected(problem, found)


def root_of(problem: Problem) -> tuple[Node, Floats]:
    """The node with a known pose (4, 4)."""
    if any(one.R is not None for one in problem.surveyed):
        return MAP, np.eye(4)
    if problem.odometry is not None:
        return ("view", 0), problem.odometry.T_fixed_camera[0]
    return ("tag", problem.anchor), np.eye(4)


def anchor_of(problem: Problem) -> int:
    """The most frequent tag of the largest group of tags seen together."""
    links = links_of(problem)
    left, largest = set(range(len(problem.names))), set[int]()
    while left:
        group = {n for kind, n in spread(links, ("tag", min(left))).T if kind == "tag"}
        left -= group
        largest = max(largest, group, key=len)
    counts = np.bincount([one.tag for one in problem.sightings], minlength=len(problem.names))
    return max(sorted(largest), key=lambda number: counts[number])


def poses(T: Floats) -> Poses:
    """(N, 4, 4) transforms as poses."""
    return Poses(T[:, :3, :3].copy(), T[:, :3, 3].copy())


def links_of(problem: Problem) -> list[PoseLink]:
    """The links, first those of the sightings in their order."""
    links = []
    for one in problem.sightings:
        best = one.hypotheses[0]
        T_rig_camera = problem.cameras[one.camera].T_first_camera
        T = T_rig_camera @ np.array(
            [from_parts(rotations.to_matrix(h.quat_xyzw), h.position_xyz) for h in one.hypotheses]
        )
        axes = np.kron(np.eye(2), T_rig_camera[:3, :3])
        covariance = axes @ best.covariance @ axes.T
        share = best.score / sum(other.score for other in one.hypotheses)
        links.append(_link(("view", one.view), ("tag", one.tag), T, covariance, max(share, 1e-3)))
    if problem.odometry is not None:
        T_fixed = problem.odometry.T_fixed_camera
        steps = inverse(T_fixed[:-1]) @ T_fixed[1:]
        for view, T in enumerate(steps):
            way = float(np.linalg.norm(T[:3, 3]))
            sigmas = np.repeat([_DRIFT[0] * way + 1e-3, _DRIFT[1] * way / 20 + 1e-4], 3)
            links.append(_link(("view", view), ("view", view + 1), T[None], np.diag(sigmas**2)))
    for known in problem.surveyed:
        if known.R is not None:
            sigmas = np.concatenate([known.position_sigma, known.R_sigma])
            T = from_parts(known.R, known.position_xyz)
            links.append(_link(MAP, ("tag", known.tag), T[None], np.diag(sigmas**2)))
    return links


def _link(first: Node, second: Node, T: Floats, covariance: Floats, share: float = 1.0) -> PoseLink:
    change = about_origin(T[0, :3, 3])
    variances = np.diag(covariance)
    variance = float(variances[:3].sum() + _ARM_M**2 * variances[3:].sum())
    return PoseLink(first, second, T, change @ covariance @ change.T, variance / share)


def spread(links: Sequence[PoseLink], start: Node, T_start: Floats | None = None) -> PoseTree:
    """The poses of all nodes that are linked with one.

    Source: E. Dijkstra, A note on two problems in connexion with graphs, 1959; the lengths are
    variances, which add up along a path.
    """
    near: Mapping[Node, list[tuple[Node, Floats, PoseLink]]] = defaultdict(list)
    for link in links:
        near[link.first].append((link.second, link.T[0], link))
        near[link.second].append((link.first, inverse(link.T[0]), link))
    tree = PoseTree()
    begun = np.eye(4) if T_start is None else T_start
    waiting: list[_Waiting] = [(0.0, 0, start, begun, None, None)]
    count = 0
    while waiting:
        variance, _, node, T, parent, by = heapq.heappop(waiting)
        if node in tree.T:
            continue
        tree.T[node], tree.parent[node] = T, parent
        tree.covariance[node] = np.zeros((6, 6))
        if parent is not None and by is not None:
            tree.covariance[node] = tree.covariance[parent] + in_map(tree, by)
        for other, step, one in near[node]:
            if other not in tree.T:
                count += 1
                heapq.heappush(
                    waiting, (variance + one.variance, count, other, T @ step, node, one)
                )
    return tree


def in_map(tree: PoseTree, link: PoseLink) -> Floats:
    """(6, 6) the covariance of a link as a twist of the map."""
    node, step = link.first, None
    if node not in tree.T:  # it is about to be added
        node, step = link.second, inverse(link.T[0])
    T = tree.T[node] if step is None else tree.T[node] @ step
    change = adjoint(T[:3, :3], T[:3, 3])
    whole: Floats = change @ link.covariance @ change.T
    return whole


def misfit(tree: PoseTree, link: PoseLink, joint: Floats) -> float:
    """Squared Mahalanobis distance of the better pose of a link; 0 if it is part of the tree."""
    whole = joint + in_map(tree, link)
    whole[np.diag_indices(6)] += 1e-12
    T_first, T_second = tree.T[link.first], tree.T[link.second]
    twists = [log(T[:3, :3], T[:3, 3]) for T in T_second @ inverse(T_first @ link.T)]
    return min(float(twist @ np.linalg.solve(whole, twist)) for twist in twists)


def to_survey(group: Mapping[Node, Floats], problem: Problem) -> Floats | None:
    """(4, 4) that moves a group to its surveyed place; None if undetermined.

    Of many triples of tags, the one that most others agree with is taken, so that a wrong position
    does not count.

    Source: M. Fischler, R. Bolles, Random Sample Consensus, 1981.
    """
    known = [one for one in problem.surveyed if ("tag", one.tag) in group]
    if len(known) < 3:
        return None
    here = np.array([group["tag", one.tag][:3, 3] for one in known])
    there = np.array([one.position_xyz for one in known])
    random = np.random.default_rng(0)
    best, least = _fitted(here, there), np.inf
    for _ in range(_TRIPLES if len(known) > 3 else 0):
        few = random.choice(len(known), 3, replace=False)
        T = _fitted(here[few], there[few])
        off = np.linalg.norm(here @ T[:3, :3].T + T[:3, 3] - there, axis=1)
        if np.median(off) < least:
            fits = off <= 3 * np.median(off)
            best, least = _fitted(here[fits], there[fits]), float(np.median(off))
    return best


def _fitted(here: Floats, there: Floats) -> Floats:
    """(4, 4) that moves points to others.

    Source: K. Arun, T. Huang, S. Blostein, Least-Squares Fitting of Two 3-D Point Sets, 1987.
    """
    middle, wanted = here.mean(axis=0), there.mean(axis=0)
    U, _, Vt = np.linalg.svd((there - wanted).T @ (here - middle))
    R = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    return from_parts(R, wanted - R @ middle)


def _collected(problem: Problem, found: Mapping[Node, Floats]) -> InitialPoses:
    views, tags = problem.counts
    of_views = [found.get(("view", number)) for number in range(views)]
    of_tags = [found.get(("tag", number)) for number in range(tags)]
    return InitialPoses(
        np.array([np.eye(4) if T is None else T for T in of_views]).reshape(-1, 4, 4),
        np.array([np.eye(4) if T is None else T for T in of_tags]).reshape(-1, 4, 4),
        np.array([T is not None for T in of_views], bool),
        np.array([T is not None for T in of_tags], bool),
    )

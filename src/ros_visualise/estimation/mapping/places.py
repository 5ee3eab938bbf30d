"""Tags that are at several places in a recording, and surveyed tags that are elsewhere.

A tag that was moved, or a duplicate id, ties distant parts of a map together, and all
that hangs by it alone is wrong with it, without any contradiction in one image. But loops through
it do not close. So each tag that many such loops contain is tried as several tags, one for each
time that it was in sight; the times at which it was at the same place are joined again. And each
surveyed tag is tried without its survey. The tag that closes most loops, at least two, is wrong.
Small displacements do not matter here: they show when all is fitted (`outliers`).

Source: Y. Latif, C. Cadena, J. Neira, Robust loop closing over time for pose graph SLAM, IJRR 2013,
for the test of links in groups.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.gates import GATES
from ros_visualise.estimation.mapping.noise import PASS_NS
from ros_visualise.estimation.mapping.normal import Numbers
from ros_visualise.estimation.mapping.outliers import HANGING, MOVED, SURVEY, TWICE, Outlier
from ros_visualise.estimation.mapping.problem import Problem
from ros_visualise.estimation.mapping.starting import (
    MAP,
    Node,
    PoseLink,
    PoseTree,
    anchor_of,
    links_of,
    misfit,
    root_of,
    spread,
    to_survey,
)

_OPEN = 4 * GATES[6]  # squared distance of an open loop
_NEAR, _FAR = 5.0, 10.0  # sides of a tag: at the same place; an open loop
_TRIED, _ROUNDS = 24, 6
_STANDS_OUT, _LEAST_SURVEYED = 5.0, 5  # times the median; tags
_GAIN, _AS_GOOD = 2, 0.9  # least number of loops that close; fraction of a rival explanation


class _Explanation(NamedTuple):
    """A tag that is several, or whose survey is wrong, as other links."""

    tag: int
    is_survey: bool
    links: list[PoseLink]
    places: int


def separated(problem: Problem) -> tuple[Problem, list[Outlier]]:
    """The problem with one tag for each place, and without wrong surveys.

    Where several explanations close as many loops, the tags that they place differently are named
    `HANGING`.
    """
    if not problem.sightings:
        return problem, []
    problem = replace(problem, anchor=anchor_of(problem))
    if problem.odometry is not None:  # it ties all views, so the map bends and `outliers` sees it
        return _surveyed_well(problem)
    links, start = links_of(problem), root_of(problem)
    size_m, scale = float(np.median([one.size_m for one in problem.sightings])), 0.0
    wrong: set[int] = set()
    split: set[int] = set()
    doubts: dict[str, Outlier] = {}
    for _ in range(_ROUNDS):
        tree = spread(links, *start)
        loops = _loops(tree, links)
        scale = scale or max(1.0, float(np.median([one.distance2 for one in loops] or [0])) / 5.35)
        still, linked = _open(loops, scale, size_m), _linked(tree, links)
        astray = _astray(problem, tree, _FAR * size_m) if still else 0
        tried = []
        for change in _changes(problem, links, still, split):
            if not change.is_survey:
                change = _joined(problem, change, spread(change.links, *start), scale)
            then = spread(change.links, *start)
            after = _open(_loops(then, change.links), scale, size_m)
            lost = max(linked - _linked(then, change.links), 0)
            fewer = len(still) - len(after) - lost
            fewer += astray - _astray(problem, then, _FAR * size_m)
            tried.append((fewer, change.places, change, then))
        gain, _, best, tree = max(tried, key=lambda one: one[:2], default=(0, 0, None, tree))
        if best is None or gain < _GAIN:
            break
        rivals = [one for one in tried if one[2] is not best and one[0] >= _AS_GOOD * gain]
        doubts |= _ambiguous(problem, best, tree, [one[2:] for one in rivals], _FAR * size_m)
        links = best.links
        (wrong if best.is_survey else split).add(best.tag)
    problem, named = _renamed(problem, links, spread(links, *start), split, wrong, scale)
    far_off: list[Outlier] = []
    if start[0] != MAP:
        problem, far_off = _surveyed_well(problem)
    return problem, [*named, *far_off, *doubts.values()]


def _surveyed_well(problem: Problem) -> tuple[Problem, list[Outlier]]:
    """The problem without surveyed positions that are far from where the views see these tags.

    When all are moved to fit the survey, such a one stands out from the others.
    """
    tree = spread(links_of(replace(problem, surveyed=())), *root_of(replace(problem, surveyed=())))
    T = to_survey(tree.T, problem)
    known = [one for one in problem.surveyed if ("tag", one.tag) in tree.T]
    if T is None or len(known) < _LEAST_SURVEYED:
        return problem, []
    places = np.array([(T @ tree.T["tag", one.tag])[:3, 3] for one in known])
    off = np.linalg.norm(places - [one.position_xyz for one in known], axis=1)
    far = off > max(_STANDS_OUT * float(np.median(off)), _FAR * problem.sightings[0].size_m)
    if far.sum() > len(far) / 4:
        return problem, []  # the views are bent, or all of the survey is wrong
    explained = [
        Outlier(
            problem.names[one.tag],
            SURVEY,
            f"its surveyed position is {metres:.2f} m from where the views place it; ignored",
            float(metres),
        )
        for one, metres, is_far in zip(known, off, far, strict=True)
        if is_far
    ]
    wrong = {one.name for one in explained}
    rest = [one for one in problem.surveyed if problem.names[one.tag] not in wrong]
    return replace(problem, surveyed=rest), explained


def _ambiguous(
    problem: Problem,
    best: _Explanation,
    tree: PoseTree,
    rivals: Sequence[tuple[_Explanation, PoseTree]],
    far_m: float,
) -> dict[str, Outlier]:
    """The tags whose place depends on the choice between explanations that are as good."""
    blamed = {change.tag for change, _ in rivals} | {best.tag}
    wrong = " or ".join(problem.names[tag] for tag in sorted(blamed))
    found: dict[str, Outlier] = {}
    for tag, name in enumerate(problem.names):
        at = tree.T.get(("tag", tag))
        others = [then.T.get(("tag", tag)) for _, then in rivals]
        if any(one.tag == tag for one in problem.surveyed) and tag not in blamed:
            continue  # its place is known by hand
        moved = [at is None or T is None or _apart(at, T) > far_m for T in others]
        if any(moved) or (rivals and tag in blamed):
            text = (
                f"connected only through {wrong}, and one of these has moved; omitted from the map"
            )
            found[name] = Outlier(
                name, HANGING, f"{text} (use --ignore-tags, or give new ids with --tags)"
            )
    return found


def _apart(a: Floats, b: Floats) -> float:
    return float(np.linalg.norm(a[:3, 3] - b[:3, 3]))


class _PoseLoop(NamedTuple):
    """By how much a loop is open: squared distance, and metres; and its nodes."""

    distance2: float
    off_m: float
    path: list[Node]


def _loops(tree: PoseTree, links: Sequence[PoseLink]) -> list[_PoseLoop]:
    found = []
    for link in links:
        a, b = link.first, link.second
        if a in tree.T and b in tree.T and a != tree.parent[b] and b != tree.parent[a]:
            path, joint = tree.loop(a, b)
            apart = (tree.T[a] @ link.T)[:, :3, 3] - tree.T[b][:3, 3]
            off_m = float(np.linalg.norm(apart, axis=1).min())
            found.append(_PoseLoop(misfit(tree, link, joint), off_m, path))
    return found


def _open(loops: Sequence[_PoseLoop], scale: float, size_m: float) -> list[list[Node]]:
    """The paths of loops that are far open."""
    return [
        one.path for one in loops if one.distance2 > _OPEN * scale and one.off_m > _FAR * size_m
    ]


def _astray(problem: Problem, tree: PoseTree, far_m: float) -> int:
    """Number of tags that are not at their surveyed position when all are moved to fit these."""
    T = to_survey(tree.T, problem) if MAP not in tree.T else None
    if T is None:
        return 0
    known = [one for one in problem.surveyed if ("tag", one.tag) in tree.T]
    off = [np.linalg.norm((T @ tree.T["tag", o.tag])[:3, 3] - o.position_xyz) for o in known]
    return int((np.array(off) > max(far_m, _STANDS_OUT * float(np.median(off)))).sum())


def _linked(tree: PoseTree, links: Sequence[PoseLink]) -> int:
    """Number of sightings that are connected with the start."""
    return sum(one.first in tree.T and one.second in tree.T for one in links if one.first != MAP)


def _changes(
    problem: Problem, links: Sequence[PoseLink], still: Sequence[list[Node]], split: set[int]
) -> list[_Explanation]:
    """Possible explanations of open loops."""
    found: list[_Explanation] = []
    counts = Counter(node for path in still for node in path if node[0] == "tag")
    surveyed = Counter(
        node
        for path in still
        for at, other in pairwise(path)
        if MAP in (at, other)
        for node in (at, other)
        if node != MAP
    )
    for (_, tag), count in counts.most_common():
        if tag >= len(problem.names) or tag in split or count < _GAIN or len(found) >= _TRIED:
            continue
        parts = _times_in_sight(problem, tag)
        if parts.max(initial=0) > 0:
            several = [*links]
            for row, part in zip(_rows(problem, tag), parts, strict=True):
                several[row] = links[row]._replace(second=_node(problem, tag, int(part)))
            several = [one for one in several if one.first != MAP or one.second != ("tag", tag)]
            found.append(_Explanation(tag, False, several, 0))
    for node, count in surveyed.most_common(_TRIED):
        if count >= _GAIN:
            rest = [one for one in links if one.first != MAP or one.second != node]
            found.append(_Explanation(node[1], True, rest, 0))
    return found


def _rows(problem: Problem, tag: int) -> Numbers:
    return np.flatnonzero([one.tag == tag for one in problem.sightings])


def _node(problem: Problem, tag: int, part: int) -> Node:
    """A tag in one of the times that it was in sight."""
    return "tag", tag + part * len(problem.names)


def _times_in_sight(problem: Problem, tag: int) -> Numbers:
    """For each sighting of a tag, how often it was out of sight before."""
    stamps = np.array([problem.stamps_ns[problem.sightings[r].view] for r in _rows(problem, tag)])
    order = np.argsort(stamps, kind="stable")
    parts = np.zeros(len(stamps), int)
    parts[order[1:]] = np.cumsum(np.diff(stamps[order]) > PASS_NS)
    return parts


def _joined(problem: Problem, change: _Explanation, tree: PoseTree, scale: float) -> _Explanation:
    """The tag at its places only, instead of once for each time in sight."""
    places = _places(problem, tree, change.tag, scale)
    links = [*change.links]
    for node, rows in places:
        for row in rows:
            links[row] = links[row]._replace(second=node)
    return change._replace(links=links, places=len(places))


def _renamed(
    problem: Problem,
    links: Sequence[PoseLink],
    tree: PoseTree,
    split: set[int],
    wrong: set[int],
    scale: float,
) -> tuple[Problem, list[Outlier]]:
    """The problem with a name for each place, and what is said of it."""
    names, sightings = [*problem.names], [*problem.sightings]
    explained = []
    for tag in sorted(split):
        places = _places(problem, tree, tag, scale)
        kept, is_surveyed = _kept(problem, tree, tag, places, scale)
        if not is_surveyed:
            wrong.add(tag)
        for number, (_, rows) in enumerate(places):
            if number != kept:
                names.append(f"{problem.names[tag]} elsewhere")
                for row in rows:
                    sightings[row] = replace(sightings[row], tag=len(names) - 1)
        if len(places) > 1:
            explained.append(_explained(problem, tree, tag, places, kept))
    surveyed = [one for one in problem.surveyed if one.tag not in wrong]
    for one in problem.surveyed:
        if one.tag in wrong:
            text = "its surveyed pose disagrees with observations of the other tags; ignored"
            explained.append(Outlier(problem.names[one.tag], SURVEY, text))
    return replace(problem, names=names, sightings=sightings, surveyed=surveyed), explained


_TagPlace = tuple[Node, Numbers]
"""A tag at one place, and its sightings."""


def _places(problem: Problem, tree: PoseTree, tag: int, scale: float) -> list[_TagPlace]:
    """The places of a tag, the one that was seen most often first."""
    parts, rows = _times_in_sight(problem, tag), _rows(problem, tag)
    found: list[_TagPlace] = []
    for part in np.argsort(-np.bincount(parts), kind="stable"):
        node, seen = _node(problem, tag, int(part)), rows[parts == part]
        for number, (place, several) in enumerate(found):
            if _is_same(problem, tree, node, place, scale):
                found[number] = place, np.sort(np.concatenate([several, seen]))
                break
        else:
            found.append((node, seen))
    return sorted(found, key=lambda one: -len(one[1]))


def _is_same(problem: Problem, tree: PoseTree, a: Node, b: Node, scale: float) -> bool:
    """True if a tag was at the same place twice; smaller displacements show when all is fitted."""
    if a not in tree.T or b not in tree.T:
        return True
    size_m = next(o.size_m for o in problem.sightings if o.tag == a[1] % len(problem.names))
    if _apart(tree.T[a], tree.T[b]) < _NEAR * size_m:
        return True
    link = PoseLink(a, b, np.eye(4)[None], np.zeros((6, 6)), 0.0)
    return misfit(tree, link, tree.loop(a, b)[1]) < _OPEN * scale


def _kept(
    problem: Problem, tree: PoseTree, tag: int, places: Sequence[_TagPlace], scale: float
) -> tuple[int, bool]:
    """The place that keeps the name: the surveyed one, else the last, else the most seen.

    Also True if a survey agrees with it.
    """
    links = [one for one in links_of(problem) if one.first == MAP and one.second == ("tag", tag)]
    for number, (node, _) in enumerate(places):
        for link in links:
            there = link._replace(second=node)
            if node in tree.T and misfit(tree, there, tree.covariance[node]) < _OPEN * scale:
                return number, True
    times = [problem.stamps_ns[[problem.sightings[r].view for r in rows]] for _, rows in places]
    order = sorted(range(len(places)), key=lambda one: int(times[one].min()))
    follow = pairwise(order)
    if all(times[one].max() < times[after].min() for one, after in follow):
        return order[-1], False
    return 0, False


def _explained(
    problem: Problem, tree: PoseTree, tag: int, places: Sequence[_TagPlace], kept: int
) -> Outlier:
    times = [problem.stamps_ns[[problem.sightings[r].view for r in rows]] for _, rows in places]
    at = [tree.T[node][:3, 3] for node, _ in places if node in tree.T]
    apart = max((float(np.linalg.norm(a - b)) for a in at for b in at), default=0.0)
    spans = ", ".join(f"{one.min() / 1e9:.1f} to {one.max() / 1e9:.1f} s" for one in times)
    text = (
        f"at {len(places)} places up to {apart:.2f} m apart, seen from {spans}; the map contains "
    )
    begin = times[kept].min() / 1e9
    is_last = all(one.max() < times[kept].min() for k, one in enumerate(times) if k != kept)
    text += (
        f"the place seen from {begin:.1f} s on; use --tags to give the tag a new id at each of the"
        " other places"
    )
    return Outlier(problem.names[tag], MOVED if is_last else TWICE, text, apart)

"""The navigator driven through a world, by its node alone, and judged by the truth."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from world import T0, Event, Pose, S, World, frame, log, matrix_of, mounting

from ros_visualise.core.errors import NoTransform
from ros_visualise.core.params import update
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.nodes.landmark_navigator import LandmarkNavigator

FALSE = 25.0
"""Squared distance, by the covariance of the position, at which an estimate is falsely certain:
5 sigma, once in 65,000 times."""


def params(**values):
    """The navigator's parameters; corners as noisy as their detector states."""
    return update(LandmarkNavigator.declared.params(), {"corner_floor": 0.0} | values)


class Lines(logging.Handler):
    """Messages logged by the package."""

    def __init__(self):
        super().__init__(logging.WARNING)
        self.lines: list[str] = []

    def emit(self, record):
        self.lines.append(record.getMessage())

    def __enter__(self):
        logging.getLogger("ros_visualise").addHandler(self)
        return self

    def __exit__(self, *_):
        logging.getLogger("ros_visualise").removeHandler(self)


@dataclass
class Run:
    """What a navigator published, by true time of its stamp.

    Attributes:
        poses: (time, T_map_base, covariance (6, 6)) of each pose.
        states: (time of its arrival, status) of each of the diagnostics.
        landmarks: the last of each, by id, with the time of the last message.
        counts: (time, number of landmarks used, number with the candidates).
    """

    node: Any
    params: Any
    poses: list[tuple[float, Pose, Any]] = field(default_factory=list)
    states: list[tuple[float, Any]] = field(default_factory=list)
    landmarks: dict[str, Any] = field(default_factory=dict)
    counts: list[tuple[float, int, int]] = field(default_factory=list)
    odometries: list[float] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)

    @property
    def report(self) -> Mapping[str, Any]:
        return self.node.report()

    @property
    def values(self) -> Mapping[str, str]:
        """Values of the last diagnostics."""
        return self.states[-1][1].values if self.states else {}

    def said(self, from_s=0.0):
        """All that it says of itself, as one text."""
        parts = list(self.lines)
        for at, status in self.states:
            if at >= from_s:
                parts.append(status.message)
                parts += [f"{name}: {value}" for name, value in status.values.items()]
        parts += [f"{name}: {value}" for name, value in self.report.items()]
        return "\n".join(parts)

    def says(self, pattern, from_s=0.0):
        return re.search(pattern, self.said(from_s), re.IGNORECASE) is not None

    def sentence(self, from_s, until_s):
        """The commonest message of the diagnostics that are not OK."""
        several = [s.message for at, s in self.states if from_s <= at < until_s and s.level > 0]
        return max(set(several), key=several.count) if several else ""

    def counted(self, pattern):
        """The largest count by names that match, in its report and its last diagnostics."""
        several = {**self.values, **self.report}
        found = [v for name, v in several.items() if re.search(pattern, str(name), re.IGNORECASE)]
        return max((int(v) for v in found if re.fullmatch(r"\d+", str(v))), default=0)

    def errors(self, world: World, from_s=0.0, until_s=np.inf):
        """(N, 6) of position and rotation, and their covariances (N, 6, 6)."""
        rows, covariances = [], []
        for t, (R, p), P in self.poses:
            if from_s <= t <= until_s:
                truth = world.truth(t)
                rows.append(np.concatenate([p - truth.p, log(R @ truth.R.T)]))
                covariances.append(P)
        return np.array(rows).reshape(-1, 6), np.array(covariances).reshape(-1, 6, 6)

    def nees(self, world: World, from_s=0.0, until_s=np.inf, size=3):
        """(N,) squared errors by their covariance, of position or of the whole pose."""
        e, P = self.errors(world, from_s, until_s)
        e, P = e[:, :size], P[:, :size, :size]
        return np.einsum("ni,ni->n", e, np.linalg.solve(P, e[..., None])[..., 0])

    def off(self, world: World, from_s=0.0, until_s=np.inf):
        """(N,) errors of position, metres."""
        return np.linalg.norm(self.errors(world, from_s, until_s)[0][:, :3], axis=1)

    def located(self, from_s=0.0, until_s=np.inf):
        """Part of the odometries that have a pose."""
        of_all = sum(from_s <= t <= until_s for t in self.odometries)
        return sum(from_s <= t <= until_s for t, *_ in self.poses) / max(of_all, 1)

    def falsely_certain(self, world: World, from_s=0.0, until_s=np.inf):
        """Part of the odometries at which it publishes a pose that its covariance excludes."""
        of_all = sum(from_s <= t <= until_s for t in self.odometries)
        return float((self.nees(world, from_s, until_s) > FALSE).sum() / max(of_all, 1))


def drive(
    events: Sequence[Event],
    settings: Any,
    changes: Sequence[tuple[float, Any]] = (),
    tf_s: float = -1.0,
    run: Run | None = None,
    start: Pose | None = None,
) -> Run:
    """Give a navigator all messages.

    Args:
        changes: parameters from a time of arrival on.
        tf_s: when the mountings of the sensors come on tf_static.
        run: one to go on with.
        start: T_map_odom, as a frame odom_start.
    """
    run = run or Run(LandmarkNavigator(settings), settings)
    given = FrameTree()
    if start:
        given.add(frame("map", "odom_start", start), static=True)
    changes, is_mounted = list(changes), False
    with Lines() as log_lines:
        for event in events:
            if not is_mounted and event.arrival_s >= tf_s:
                given.add(mounting(), static=True)
                is_mounted = True
            while changes and event.arrival_s >= changes[0][0]:
                run.params = changes.pop(0)[1]
            if event.port == "tf":
                given.add(event.message)
                continue
            try:
                answer = run.node.step(run.params, **{event.port: event.message}, frames=given)
            except NoTransform as error:
                run.failures.append(str(error))
                continue
            _note(run, event, answer or {})
    run.lines += log_lines.lines
    return run


def _note(run, event, answer):
    if event.port == "odometry":
        run.odometries.append(event.message.header.stamp_ns / S - T0)
    if "pose" in answer:
        one = answer["pose"]
        pose = Pose(matrix_of(one.quat_xyzw), one.position_xyz)
        run.poses.append((one.header.stamp_ns / S - T0, pose, one.covariance))
    if "diagnostics" in answer:
        run.states += [(event.arrival_s, one) for one in answer["diagnostics"].statuses]
    if "landmarks" in answer:
        run.landmarks = {one.id: one for one in answer["landmarks"].detections}
        plates = sum(marker.ns == "plate" for marker in answer["markers"].markers)
        run.counts.append((event.arrival_s, len(run.landmarks), plates))

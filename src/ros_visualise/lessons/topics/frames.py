"""The frame tree, transforms from tf, and the drift of odometry."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ros_visualise.core.errors import NoTransform
from ros_visualise.core.params import param
from ros_visualise.data import Floats, Message, Odometry, Transforms
from ros_visualise.geometry import rotations
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.lessons.lesson import GIVES, WIDTH, Lesson, Step, show_at
from ros_visualise.lessons.methods.drift import aligned, error_by_heading, wrapped
from ros_visualise.nodes import node
from ros_visualise.plotting.axes import PlotAxes
from ros_visualise.plotting.colors import BLUE, GRAY, GREEN, INK, RED
from ros_visualise.plotting.diagrams import tree_rows
from ros_visualise.plotting.figure import Figure

_PERIOD_NS = 1_000_000_000
_ROW, _INDENT = 30, 34
_MOST = 100_000  # largest number of poses


@dataclass(frozen=True)
class TreeParams:
    """The query to tf."""

    target: str = param("", "the frame in which the pose is given; empty: the root")
    source: str = param("", "the frame whose pose is wanted; empty: the deepest in the tree")


@node("tree", params=TreeParams, inputs={"tf": Transforms}, outputs=GIVES, frames=True)
class Tree:
    """The frame tree, and a transform from tf."""

    def __init__(self, _: TreeParams) -> None:
        self._reported_ns: int | None = None

    def reset(self) -> None:
        self._reported_ns = None

    def step(
        self, tf: Transforms, params: TreeParams, frames: FrameTree
    ) -> dict[str, Message] | None:
        """Every second: the present tree."""
        stamp_ns = tf.header.stamp_ns
        if self._reported_ns is not None and 0 <= stamp_ns - self._reported_ns < _PERIOD_NS:
            return None
        self._reported_ns = stamp_ns
        chains = {name: _chain(frames, name) for name in frames.frames()}
        if not chains:
            return None
        deepest = max(chains, key=lambda name: len(chains[name]))
        source = params.source or deepest
        target = params.target or chains.get(source, [source])[0]
        text = """
            Where is the camera, seen from the map? Each part of a robot has a frame: an origin and
            three axes. Each frame has a pose in one other frame, its parent, so all frames form a
            tree; here there are {count}. tf computes the pose of any frame in any other, now or
            some seconds ago, by multiplying the transforms along the path:

            {product}

            {answer}

            By convention (REP 105), base_link is the robot's own frame. In odom the robot moves
            smoothly, but its pose drifts. In map it does not drift, but may jump when it is
            corrected. The transform from map to odom is this correction.
            """
        try:
            answer = _answer(frames.lookup(target, source), target, source)
        except NoTransform as error:
            answer = str(error)
        return show_at(
            tf.header,
            _draw_tree(frames),
            text,
            count=len(chains),
            product=_product(target, chains.get(source, [source])),
            answer=answer,
        )


class _Way:
    """Poses in the plane: stamps in ns, x, y in metres and the heading in radians."""

    def __init__(self) -> None:
        self.rows: list[tuple[float, float, float, float]] = []

    def add(self, odometry: Odometry) -> None:
        """Add a pose, if it is later than the last."""
        stamp_ns = odometry.header.stamp_ns
        if self.rows and stamp_ns <= self.rows[-1][0]:
            return
        x, y, _ = odometry.position_xyz
        self.rows.append((stamp_ns, x, y, float(rotations.to_rpy(odometry.quat_xyzw)[2])))
        if len(self.rows) > _MOST:
            self.rows = self.rows[::2]

    def at(self, stamps_ns: Floats) -> tuple[Floats, Floats]:
        """Interpolated positions (N, 2) and headings (N,) at these times."""
        known = np.array(self.rows)
        x, y = (np.interp(stamps_ns, known[:, 0], known[:, column]) for column in (1, 2))
        return np.stack([x, y], axis=1), np.interp(stamps_ns, known[:, 0], np.unwrap(known[:, 3]))


@node("drift", inputs={"odom": Odometry, "truth": Odometry}, outputs=GIVES)
class Drift:
    """Odometry, and its drift where the truth is known."""

    def __init__(self, _: object) -> None:
        self.reset()

    def reset(self) -> None:
        self._odom, self._truth = _Way(), _Way()
        self._reported_ns: int | None = None

    def step(
        self, params: object, odom: Odometry | None = None, truth: Odometry | None = None
    ) -> dict[str, Message] | None:
        """Every second: both paths so far."""
        if truth is not None:
            self._truth.add(truth)
        if odom is None:
            return None
        self._odom.add(odom)
        stamp_ns = odom.header.stamp_ns
        is_due = self._reported_ns is None or not 0 <= stamp_ns - self._reported_ns < _PERIOD_NS
        if not is_due or len(self._odom.rows) < 2:
            return None
        self._reported_ns = stamp_ns
        stamps = np.array(self._odom.rows)[:, 0]
        if len(self._truth.rows) < 2:
            places, _ = self._odom.at(stamps)
            figure = _draw_way([(places, BLUE)])
            figure.text(WIDTH - 20, 20, "odometry only; true path unknown", 13, "end", BLUE)
            text = f"""
                The path from odometry is {_length(places):.2f} m long so far. This recording does
                not contain the true path, so the drift is unknown, and only odometry is drawn. A
                simulated robot knows its true path; to see it, run this lesson without a file.
                """
            return show_at(odom.header, figure, text)
        return self._compare(odom, stamps[stamps <= self._truth.rows[-1][0]])

    def _compare(self, odom: Odometry, stamps: Floats) -> dict[str, Message] | None:
        if len(stamps) < 2:
            return None
        places, headings = self._odom.at(stamps)
        true_places, true_headings = self._truth.at(stamps)
        places = aligned(places, headings, true_places[0], float(true_headings[0]))
        turned = wrapped(headings - headings[0] - (true_headings - true_headings[0]))
        error = np.linalg.norm(places - true_places, axis=1)
        by_heading = error_by_heading(true_places, turned)
        length = _length(true_places)
        text = f"""
            Odometry adds up small steps, measured by wheels or a camera. Each step is a little
            wrong, and nothing corrects it, so the error grows (for a while errors may cancel). The
            path from odometry is blue, the true path is green.

            After {length:.2f} m the error is {error[-1]:.3f} m,
            {100 * error[-1] / max(length, 1e-9):.2f} % of the path, and the heading is
            off by {np.degrees(turned[-1]):+.2f}°. A heading that is wrong by ε turns every later
            step Δp by ε. The wrong headings alone cause an error of

                | Σ (R(ε) − I) Δp | = {by_heading[-1]:.3f} m
            """
        return show_at(
            odom.header, _draw_way([(true_places, GREEN), (places, BLUE)], (stamps, error)), text
        )


LESSON = Lesson(
    "frames",
    "the tree of frames, what tf answers, and why odometry drifts away from the truth",
    "",
    [Step(Tree), Step(Drift)],
    sample=("husky", {"world": "plane", "mission": "square", "camera": False, "lidar": False}),
    streams=True,
    plays=True,
    export_s=30.0,
)


def _chain(frames: FrameTree, name: str) -> list[str]:
    """The frames from the root down to this one."""
    chain = [name]
    while (parent := frames.parent(chain[0])) is not None and parent not in chain:
        chain.insert(0, parent)
    return chain


def _product(target: str, chain: list[str]) -> str:
    """The product of transforms to the last frame of a chain."""
    below = chain[chain.index(target) :] if target in chain else [target, chain[-1]]
    links = [f"T({parent} ← {child})" for parent, child in pairwise(below)]
    lines = [f"    T({target} ← {chain[-1]})", f"      = {links[0] if links else 'I'}"]
    return "\n".join(lines + [f"      · {link}" for link in links[1:]])


def _answer(T: Floats, target: str, source: str) -> str:
    x, y, z = T[:3, 3].round(3) + 0.0  # no minus before a zero
    angles = np.degrees(rotations.to_rpy(rotations.from_matrix(T[:3, :3])))
    roll, pitch, yaw = angles.round(1) + 0.0
    turned = f"roll {roll:.1f}°, pitch {pitch:.1f}°, yaw {yaw:.1f}°"
    return f"Now {source} is at ({x:.3f}, {y:.3f}, {z:.3f}) m in {target}, with {turned}."


def _draw_tree(frames: FrameTree) -> Figure:
    """Each frame below its parent, connected by lines."""
    names = sorted(frames.frames())
    rows = tree_rows({name: parent for name in names if (parent := frames.parent(name))})
    figure = Figure(WIDTH, max(_ROW * len(rows) + 20, 60))
    for number, row in enumerate(rows):
        left, top = 20 + _INDENT * row.depth, 26 + _ROW * number
        if row.parent is not None:
            x, above = left - _INDENT + 5, 26 + _ROW * row.parent
            figure.line(np.array([[x, above + 4], [x, top - 5], [left - 4, top - 5]]), GRAY, 1.5)
        figure.dot(left + 1, top - 5, 5, RED if row.parent is None else BLUE)
        figure.text(left + 12, top, row.name, 14, color=INK)
    return figure


def _length(places: Floats) -> float:
    return float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())


def _draw_way(
    ways: list[tuple[Floats, tuple[int, int, int]]], error: tuple[Floats, Floats] | None = None
) -> Figure:
    """Paths from above, and below them the growing error."""
    figure = Figure(WIDTH, 620 if error else 430)
    every = np.concatenate([places for places, _ in ways])
    axes = PlotAxes(figure, (70, 30, WIDTH - 90, 350), every.min(axis=0), every.max(axis=0), True)
    axes.draw("x (m)", "y (m)")
    for places, color in ways:
        axes.curve(places, color)
    if error is not None:
        points = np.stack([(error[0] - error[0][0]) / 1e9, error[1]], axis=1)
        below = PlotAxes(figure, (70, 440, WIDTH - 90, 130), np.zeros(2), points.max(axis=0))
        below.draw("time (s)", "error (m)")
        below.curve(points, RED)
    return figure

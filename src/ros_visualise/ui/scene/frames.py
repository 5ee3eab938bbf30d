"""The fixed frame, the poses of the other frames in it, and the transforms between them."""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ros_visualise.core.errors import NoTransform
from ros_visualise.data import Floats, Transforms, TransformStamped
from ros_visualise.geometry.frames import FrameTree

_REP_105 = ("map", "odom")
_SMALLEST_M, _LARGEST_M = 0.2, 1.5  # of a robot by which things are sized
_ROBOTS = ("base_link", "base_footprint")
_NS = 1_000_000_000
_KEPT = 50


@dataclass(frozen=True)
class Link:
    """One transform: ``rate_hz`` by its stamps; None where it is static or came only once."""

    parent: str
    child: str
    static: bool
    stamp_ns: int
    rate_hz: float | None


class Links:
    """Rate and age of each transform of the tree; safe to call from any thread."""

    def __init__(self) -> None:
        self._stamps_ns: dict[str, deque[int]] = {}
        self._ways: dict[str, tuple[str, bool]] = {}
        self._lock = threading.Lock()

    def add(self, one: TransformStamped, static: bool) -> None:
        child = one.child_frame_id.lstrip("/")
        with self._lock:
            self._ways[child] = one.header.frame_id.lstrip("/"), static
            stamps = self._stamps_ns.setdefault(child, deque(maxlen=_KEPT))
            if not stamps or one.header.stamp_ns > stamps[-1]:
                stamps.append(one.header.stamp_ns)

    def forget(self) -> None:
        """Count anew, as time jumped."""
        with self._lock:
            for child, stamps in self._stamps_ns.items():
                if not self._ways[child][1]:
                    stamps.clear()

    def all(self) -> list[Link]:
        """All links, by the name of the child."""
        with self._lock:
            return [
                Link(parent, child, static, stamps[-1], self._rate(child))
                for child, stamps in sorted(self._stamps_ns.items())
                for parent, static in [self._ways[child]]
                if stamps
            ]

    def _rate(self, child: str) -> float | None:
        stamps = self._stamps_ns[child]
        times = sum(1 for a, b in pairwise(stamps) if b > a)
        if self._ways[child][1] or not times:
            return None
        return times * _NS / (stamps[-1] - stamps[0])


class Frames:
    """The known frames, from transforms and messages, and the fixed one among them.

    ``chosen`` is the fixed frame that a person chose, or None: then it is the outermost one that
    REP 105 names, the root of the tree, or without transforms the frame of the most topics.
    ``awaited`` is the one before a time jump, which stays until it is known again. ``joints`` holds
    the newest positions of joints by name, in radians or metres.
    """

    def __init__(self) -> None:
        self.tree = FrameTree()
        self.links = Links()
        self.joints: dict[str, float] = {}
        self.chosen: str | None = None
        self.awaited = ""
        self._seen: dict[str, set[str]] = {}  # frame -> the topics that name it
        self._odd: set[str] = set()  # reported faults of transforms

    def add(self, message: TransformStamped | Transforms, static: bool) -> list[str]:
        """Add transforms; their faults, as far as these are new. Damaged ones are skipped."""
        several = message.transforms if isinstance(message, Transforms) else (message,)
        odd = [what for one in several if (what := self._add(one, static))]
        new = list(dict.fromkeys(what for what in odd if what not in self._odd))
        self._odd.update(new)
        return new

    def _add(self, one: TransformStamped, static: bool) -> str:
        """Add one; its fault, or nothing."""
        child, parent = _name(one.child_frame_id), _name(one.header.frame_id)
        before = self.tree.parent(child)
        try:
            self.tree.add(one, static)
        except ValueError as error:
            return str(error)
        self.links.add(one, static)
        if before not in (None, parent):
            there = " and ".join(sorted({str(before), parent}))
            return f"{child!r} has several parents: {there}"
        return ""

    def see(self, frame: str, topic: str = "") -> None:
        """Add a frame that a message of a topic named."""
        self._seen.setdefault(_name(frame), set()).add(topic)

    def forget(self) -> None:
        """Forget the transforms that move, as time jumped."""
        self.awaited = self.fixed
        self.tree.reset()
        self.links.forget()

    @property
    def names(self) -> list[str]:
        return sorted({*self.tree.frames(), *self._seen})

    @property
    def fixed(self) -> str:
        """The frame in which everything is drawn; empty until one is known."""
        in_tree = self.tree.frames()
        if self.chosen is not None and self.chosen in {*in_tree, *self._seen}:
            return self.chosen
        if self.awaited and self.awaited not in in_tree:
            return self.awaited
        named = next((name for name in _REP_105 if name in (in_tree or self._seen)), None)
        if named or in_tree:
            return named or self._largest_root()
        seen = list(self._seen.items())  # other threads may add to them
        return max(seen, key=lambda one: (one[0] != "", len(one[1])), default=("",))[0]

    @property
    def robot(self) -> str | None:
        """The frame of the robot's body, by the names of REP 105 and 120."""
        known = self.tree.frames()
        return next((name for name in _ROBOTS if name in known), None)

    @property
    def mover(self) -> str | None:
        """The moving frame with the most frames below it."""
        moving = [link.child for link in self.links.all() if not link.static]
        return max(moving, key=lambda name: len(self._below(name)), default=None)

    def robot_size_m(self, places: Mapping[str, Floats]) -> float:
        """The robot's size, from its body to its farthest part, in metres; 1 where unknown."""
        robot = self.robot
        if robot is None or robot not in places:
            return 1.0
        parts = [places[name] for name in self._below(robot) if name in places]
        away = [np.linalg.norm(T[:3, 3] - places[robot][:3, 3]) for T in parts]
        reach_m = max(away, default=0.0)
        return float(np.clip(reach_m, _SMALLEST_M, _LARGEST_M)) if reach_m else 1.0

    def _below(self, frame: str) -> list[str]:
        return [name for name in self.tree.frames() if frame in self._above(name)]

    def locate(self, frame: str, stamp_ns: int, patient: bool = False) -> Floats:
        """T_fixed_frame, 4x4, at a time; an empty name is the fixed frame.

        Args:
            stamp_ns: when; 0 is the newest.
            patient: do not fall back on the newest.

        Raises:
            NoTransform: it is unknown.
        """
        fixed, frame = self.fixed, _name(frame)
        if frame in ("", fixed):
            return np.eye(4)
        try:
            return self.tree.lookup(fixed, frame, stamp_ns or None)
        except NoTransform:
            if patient or not stamp_ns:
                raise
            return self.tree.lookup(fixed, frame)

    def places(self) -> dict[str, Floats]:
        """Frame -> its newest T_fixed_frame, of all that are connected with the fixed one."""
        found, fixed = {}, self.fixed
        for name in self.tree.frames():
            with suppress(NoTransform):
                found[name] = self.tree.lookup(fixed, name)
        return found

    def _largest_root(self) -> str:
        """The root with the most frames below it."""
        roots = self.tree.roots
        if len(roots) == 1:
            return roots[0]
        tops = Counter([name, *self._above(name)][-1] for name in self.tree.frames())
        return max(tops, key=lambda top: (tops[top], top))

    def _above(self, frame: str) -> list[str]:
        """The chain of parents; in a loop, each once."""
        above: list[str] = []
        parent = self.tree.parent(frame)
        while parent is not None and parent not in (frame, *above):
            above.append(parent)
            parent = self.tree.parent(parent)
        return above


def _name(frame: str) -> str:
    return frame.lstrip("/")

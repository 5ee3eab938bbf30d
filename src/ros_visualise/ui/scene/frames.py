"""In which frame everything is drawn, and where the other frames are in it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from contextlib import suppress

import numpy as np

from ros_visualise.core.errors import NoTransform
from ros_visualise.data import Floats, Transforms, TransformStamped
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.ui.scene.links import Links

_REP_105 = ("map", "odom")
_SMALLEST_M, _LARGEST_M = 0.2, 1.5  # of a robot by which things are sized
_ROBOTS = ("base_link", "base_footprint")


class Frames:
    """The frames that are known, by transforms or by messages, and the one that stays put.

    ``chosen`` is the fixed frame that a person asked for, or None: then it is the outermost one
    that REP 105 names, the root of the tree, or the frame of the first message. ``awaited`` is the
    one before time jumped, and holds until it is known again; empty: none. ``joints`` holds the
    newest positions of joints by name, in radians or metres.
    """

    def __init__(self) -> None:
        self.tree = FrameTree()
        self.links = Links()
        self.joints: dict[str, float] = {}
        self.chosen: str | None = None
        self.awaited = ""
        self._seen: list[str] = []
        self._odd: set[str] = set()  # what was said of transforms

    def add(self, message: TransformStamped | Transforms, static: bool) -> list[str]:
        """Learn transforms; what is wrong or odd with them, as far as that is new.

        Those that are none are left out.
        """
        several = message.transforms if isinstance(message, Transforms) else (message,)
        odd = [what for one in several if (what := self._add(one, static))]
        new = list(dict.fromkeys(what for what in odd if what not in self._odd))
        self._odd.update(new)
        return new

    def _add(self, one: TransformStamped, static: bool) -> str:
        """Learn one; what is odd with it."""
        child, parent = _name(one.child_frame_id), _name(one.header.frame_id)
        before = self.tree.parent(child)
        try:
            self.tree.add(one, static)
        except ValueError as error:
            return str(error)
        self.links.add(one, static)
        if before not in (None, parent):
            there = " and ".join(sorted({str(before), parent}))
            return f"{child!r} is in several frames: {there}"
        return ""

    def see(self, frame: str) -> None:
        """Learn that there is such a frame."""
        if _name(frame) not in self._seen:
            self._seen.append(_name(frame))

    def forget(self) -> None:
        """Time jumped: of transforms that move, none is known any more."""
        self.awaited = self.fixed
        self.tree.reset()
        self.links.forget()

    @property
    def names(self) -> list[str]:
        """All frames, sorted."""
        return sorted({*self.tree.frames(), *self._seen})

    @property
    def fixed(self) -> str:
        """The frame in which everything is drawn; empty as long as none is known."""
        in_tree = self.tree.frames()
        if self.chosen is not None and self.chosen in {*in_tree, *self._seen}:
            return self.chosen
        if self.awaited and self.awaited not in in_tree:
            return self.awaited
        for known in (in_tree, self._seen):
            for name in _REP_105:
                if name in known:
                    return name
            if known:
                return self._largest_root() if known is in_tree else known[0]
        return ""

    @property
    def robot(self) -> str | None:
        """The frame of the robot's body, if there is one by the names of REP 105 and 120."""
        known = self.tree.frames()
        return next((name for name in _ROBOTS if name in known), None)

    @property
    def mover(self) -> str | None:
        """Of the frames that move in their parents, that which most others hang below."""
        moving = [link.child for link in self.links.all() if not link.static]
        return max(moving, key=lambda name: len(self._below(name)), default=None)

    def robot_size_m(self, places: Mapping[str, Floats]) -> float:
        """The size of the robot by which things are drawn, metres.

        It is how far from its body the farthest of its parts is; 1 where that is not known.

        Args:
            places: frame -> T_fixed_frame.
        """
        robot = self.robot
        if robot is None or robot not in places:
            return 1.0
        parts = [places[name] for name in self._below(robot) if name in places]
        away = [np.linalg.norm(T[:3, 3] - places[robot][:3, 3]) for T in parts]
        reach_m = max(away, default=0.0)
        return float(np.clip(reach_m, _SMALLEST_M, _LARGEST_M)) if reach_m else 1.0

    def _below(self, frame: str) -> list[str]:
        """All frames that hang below one."""
        return [name for name in self.tree.frames() if frame in self._above(name)]

    def locate(self, frame: str, stamp_ns: int, patient: bool = False) -> Floats:
        """T_fixed_frame, 4x4, at a time; no name is the fixed frame itself.

        Args:
            frame: its name.
            stamp_ns: when; 0 is the newest that is known.
            patient: do not fall back on the newest that is known.

        Raises:
            NoTransform: it cannot be said.
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
        """Frame -> T_fixed_frame as it is known last, of all whose place is known."""
        found, fixed = {}, self.fixed
        for name in self.tree.frames():
            with suppress(NoTransform):
                found[name] = self.tree.lookup(fixed, name)
        return found

    def _largest_root(self) -> str:
        """The root that most frames hang below."""
        roots = self.tree.roots
        if len(roots) == 1:
            return roots[0]
        tops = Counter(self._top(name) for name in self.tree.frames())
        return max(tops, key=lambda top: (tops[top], top))

    def _top(self, frame: str) -> str:
        return [frame, *self._above(frame)][-1]

    def _above(self, frame: str) -> list[str]:
        """Its parent, the parent of that, and so on; of frames that go round, each once."""
        above: list[str] = []
        parent = self.tree.parent(frame)
        while parent is not None and parent not in (frame, *above):
            above.append(parent)
            parent = self.tree.parent(parent)
        return above


def _name(frame: str) -> str:
    return frame.lstrip("/")

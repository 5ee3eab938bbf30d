"""The base class of drawings, each of one topic in the scene."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.geometry import se3
from ros_visualise.plotting.colors import Color
from ros_visualise.ui.live.space.nodes import SpaceNode
from ros_visualise.ui.live.space.tree import SpaceTree
from ros_visualise.ui.scene.frames import Frames

_LEAST_FOR_POINTS = 0.5
"""Points of the surroundings are no finer than for a robot of so many metres, no larger than for
one of 1 m."""


@dataclass(frozen=True)
class Appearance:
    """Settings for all drawings: sizes for a robot of 1 m, ``max_points`` of one cloud."""

    point_size: float = 0.06
    max_points: int = 120_000
    axes_size: float = 1.0
    axes: bool = True
    names: bool = False
    covariances: bool = False

    def for_robot(self, size_m: float) -> Appearance:
        """The same in metres, for a robot of this size."""
        points = self.point_size * min(max(size_m, _LEAST_FOR_POINTS), 1.0)
        return replace(self, axes_size=self.axes_size * size_m, point_size=points)


class Drawing:
    """The nodes of one topic, below a node of their own that is where the frame is.

    Attributes:
        draws: the types of messages that it draws.
        coloring: one of ``colorings``, where the colour scheme can be chosen.
        gathers: each message changes what the messages before it have drawn.
        stays: it follows its frame until the next message; others stay where the frame was at the
            message's time.
    """

    draws: ClassVar[tuple[type, ...]] = ()
    colorings: ClassVar[type[Enum] | None] = None
    coloring: Enum | None = None
    gathers: ClassVar[bool] = False
    stays: ClassVar[bool] = False

    def __init__(self, scene: SpaceTree, name: str, color: Color) -> None:
        self._scene, self._name, self._color = scene, name, color
        self._root = scene.add(name, SpaceNode())
        self.T_fixed_frame: Floats = np.eye(4)

    def draw(self, message: Any, appearance: Appearance) -> None:
        """Show a message, in its own frame.

        Raises:
            DamagedMessage: it contradicts itself.
        """
        raise NotImplementedError

    def gather(self, message: Any, now_ns: int) -> None:
        """Add a message at that time of the data; called where it ``gathers``."""

    def update(self, frames: Frames, now_ns: int) -> str:
        """Draw what was gathered, as of that time; returns why some of it is not drawn."""
        return ""

    def frame_of(self, message: Any, frames: Frames) -> str:
        """The frame in which a message is drawn; an empty name is the fixed frame."""
        return str(message.header.frame_id)

    def settle(self, message: Any, frames: Frames) -> None:
        """Look up frames, before a message is drawn."""

    def place(self, T_fixed_frame: Floats) -> None:
        self.T_fixed_frame = T_fixed_frame
        move(self._root, T_fixed_frame)

    def reset(self) -> None:
        """Forget the past, as time jumped."""

    def extent(self) -> npt.NDArray[np.floating]:
        """Some points (N, 3) that span it, in its own frame."""
        return np.zeros((1, 3))

    def points(self) -> npt.NDArray[np.floating]:
        """Points (N, 3) that can be clicked, in its own frame."""
        return self.extent()

    @property
    def visible(self) -> bool:
        return self._root.visible

    @visible.setter
    def visible(self, visible: bool) -> None:
        self._root.visible = visible

    def remove(self) -> None:
        self._root.remove()


def move(node: SpaceNode, T: Floats) -> None:
    """Set the pose of a node in its parent's frame."""
    translation, quat_xyzw = se3.to_pose(T)
    node.position, node.wxyz = translation, to_wxyz(quat_xyzw)


def to_wxyz(quat_xyzw: npt.ArrayLike) -> Floats:
    """Quaternions (..., 4) as w, x, y, z."""
    return np.roll(np.asarray(quat_xyzw, np.float64), 1, axis=-1)


def node_name(*names: str) -> str:
    """A node's name: slashes in the given names would hang it below other nodes."""
    return "/".join(["/world", *(name.strip("/").replace("/", ".") for name in names)])

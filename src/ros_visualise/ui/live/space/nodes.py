"""The nodes of the 3D view; each has a pose in the frame of the node above it.

An attribute that is set is sent to all browsers. Lengths are in metres, colours RGB from 0 to 255.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import partial
from typing import Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from ros_visualise.plotting.colors import Color

Array = npt.NDArray[Any]
View = tuple[float, float, float, float, float, float]
"""Position and target of a camera, metres from the robot, or else in the fixed frame."""
POSE = ("position", "wxyz", "visible")
"""The attributes that are sent apart from the others."""
_WHITE: Color = (255, 255, 255)
_ORIGIN = (0.0, 0.0, 0.0)
_LEVEL = (1.0, 0.0, 0.0, 0.0)
_NO_BYTES = b""
_SMALL = 16


_none = partial(np.zeros, dtype=np.float32)


def _one_pose() -> Array:
    return np.array([[0.0, 0, 0, 1, 0, 0, 0]])


class _Tree(Protocol):
    def change(self, node: SpaceNode, name: str, value: Any) -> None: ...

    def remove(self, node: SpaceNode) -> None: ...


@dataclass(eq=False, kw_only=True)
class SpaceNode:
    """A frame: nodes below it move with it, and are hidden with it."""

    kind: ClassVar[str] = "frame"

    position: Sequence[float] | Array = _ORIGIN
    wxyz: Sequence[float] | Array = _LEVEL
    visible: bool = True

    def __setattr__(self, name: str, value: Any) -> None:
        value = _sendable(value)
        if self.tree is not None and not _is_same(self.__dict__[name], value):
            self.tree.change(self, name, value)
        self.__dict__[name] = value

    @property
    def tree(self) -> _Tree | None:
        """The tree that it is in, or None."""
        return self.__dict__.get("tree")

    def join(self, tree: _Tree | None) -> None:
        """Send what is set from now on to browsers of this tree."""
        self.__dict__["tree"] = tree

    def remove(self) -> None:
        """Remove it and all nodes below it."""
        if self.tree is not None:
            self.tree.remove(self)

    @property
    def values(self) -> dict[str, Any]:
        """All attributes by their names."""
        return {one.name: self.__dict__[one.name] for one in fields(self)}


@dataclass(eq=False, kw_only=True)
class Points(SpaceNode):
    """Points (N, 3), float16 or float32, of ``colors`` (N, 3) or (3,), round or square."""

    kind = "points"

    points: Array = field(default_factory=partial(_none, (0, 3)))
    colors: Array | Color = _WHITE
    size: float = 0.05
    square: bool = False


@dataclass(eq=False, kw_only=True)
class Lines(SpaceNode):
    """Lines from start to end, (N, 2, 3), of ``colors`` (N, 2, 3) or (3,).

    ``width`` is in pixels, or in metres for ``in_metres``.
    """

    kind = "lines"

    points: Array = field(default_factory=partial(_none, (0, 2, 3)))
    colors: Array | Color = _WHITE
    width: float = 2.5
    in_metres: bool = False


@dataclass(eq=False, kw_only=True)
class Arrows(SpaceNode):
    """Arrows from start to end, (N, 2, 3), of one colour; ``width`` of their shafts."""

    kind = "arrows"

    points: Array = field(default_factory=partial(_none, (0, 2, 3)))
    color: Color = _WHITE
    width: float = 0.04


@dataclass(eq=False, kw_only=True)
class Axes(SpaceNode):
    """Axes at many poses: x red, y green, z blue.

    ``poses`` (N, 7) are positions and quaternions w, x, y, z; ``origin`` colours a ball in the
    middle.
    """

    kind = "axes"

    poses: Array = field(default_factory=_one_pose)
    length: float = 0.5
    radius: float = 0.012
    origin: Color | None = None


@dataclass(eq=False, kw_only=True)
class Solids(SpaceNode):
    """Copies of a ``shape``: cube, sphere, cylinder or cone, 1 m wide and high.

    The middle of a shape is its origin, that of a cone the middle of its bottom; z is the axis.
    ``rows`` (N, 14), float32, hold a position, a quaternion w, x, y, z, sizes along the axes, and
    RGBA from 0 to 1.
    """

    kind = "solids"

    shape: str = "cube"
    rows: Array = field(default_factory=partial(_none, (0, 14)))


def solid_row(size: Sequence[float] | Array, color: Color, opacity: float = 1.0) -> Array:
    """The rows (1, 14) of one solid with lengths (3,) along its axes."""
    rgb = np.array(color) / 255
    return np.array([[*_ORIGIN, *_LEVEL, *size, *rgb, opacity]], np.float32)


@dataclass(eq=False, kw_only=True)
class Mesh(SpaceNode):
    """Triangles ``faces`` (F, 3) between ``vertices`` (V, 3), seen from both sides.

    ``colors`` are (V, 4), uint8, or one for all.
    """

    kind = "mesh"

    vertices: Array = field(default_factory=partial(_none, (0, 3)))
    faces: Array = field(default_factory=partial(_none, (0, 3), dtype=np.uint32))
    colors: Array | Color = _WHITE
    opacity: float = 1.0


@dataclass(eq=False, kw_only=True)
class Label(SpaceNode):
    """A text; its capital letters have this height, or ``pixels`` on the screen where it is 0.

    It stands above its place, or around it for ``centred``; without a colour it has that of texts.
    """

    kind = "label"

    text: str = ""
    color: Color | None = None
    height: float = 0.0
    pixels: float = 13.0
    centred: bool = False


@dataclass(eq=False, kw_only=True)
class ImagePlane(SpaceNode):
    """An image, JPEG or PNG, in the xy plane around the origin, its top towards y."""

    kind = "picture"

    image: bytes = _NO_BYTES
    width: float = 1.0
    height: float = 1.0


@dataclass(eq=False, kw_only=True)
class Frustum(SpaceNode):
    """The field of view of a camera that looks along z, x right, with its image, JPEG or PNG.

    ``fov`` is vertical, in radians; ``aspect`` is width over height; the image is at ``length``.
    """

    kind = "frustum"

    fov: float = 1.0
    aspect: float = 1.0
    length: float = 0.6
    color: Color = _WHITE
    image: bytes = _NO_BYTES


@dataclass(eq=False, kw_only=True)
class Grid(SpaceNode):
    """An endless grid in the xy plane."""

    kind = "grid"


@dataclass(eq=False, kw_only=True)
class ViewHints(SpaceNode):
    """Hints by which browsers choose their views.

    ``robot`` is its position, (3,) or empty; ``frames`` can be followed, at ``places`` (N, 3).
    ``home`` is the position and the target of a camera from the robot, or else from the origin,
    (6,), and ``homes`` another number whenever cameras that nobody moved are to go there.
    """

    kind = "view"

    robot: Array = field(default_factory=partial(_none, 0, dtype=np.float64))
    frames: tuple[str, ...] = ()
    places: Array = field(default_factory=partial(_none, (0, 3), dtype=np.float64))
    home: View = (-8.0, -6.0, 6.0, 0.0, 0.0, 0.0)
    homes: int = 0


def _sendable(value: Any) -> Any:
    """A value that does not change any more.

    Raises:
        ValueError: it is not a finite number.
    """
    if isinstance(value, np.ndarray):
        return np.array(value, order="C")
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError("a value is not a finite number")
    return value


def _is_same(before: Any, value: Any) -> bool:
    """True if a small value is the one before; large ones are not compared."""
    if isinstance(before, np.ndarray) or isinstance(value, np.ndarray):
        return np.size(before) == np.size(value) <= _SMALL and np.array_equal(before, value)
    return bool(before == value)

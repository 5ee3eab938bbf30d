"""Maps, as pictures on the ground."""

from __future__ import annotations

from enum import Enum
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import OccupancyGrid, Pixels
from ros_visualise.geometry import se3
from ros_visualise.plotting.colors import Color
from ros_visualise.ui.live.space.nodes import ImagePlane
from ros_visualise.ui.live.space.tree import SpaceTree
from ros_visualise.ui.scene.drawing import Appearance, Drawing, move

_SHARP_PX, _MAX_PX = 800, 2048
"""A picture's longer side: with fewer pixels cells would blur, more would take too long."""
_UNKNOWN, _BEYOND = (0x70, 0x89, 0x86), (0, 255, 0)
_LETHAL, _INSCRIBED = (255, 0, 255), (0, 255, 255)
_LAYER_M = 0.01


class Scheme(Enum):
    """Colour schemes of maps; ``AUTO`` is costs where the topic's name has "costmap" in it."""

    AUTO = "Auto"
    MAP = "Map"
    COSTS = "Costs"


class GridDrawing(Drawing):
    """An `OccupancyGrid`; while its cells stay the same only its pose is sent."""

    draws = (OccupancyGrid,)

    colorings = Scheme
    stays = True

    def __init__(self, scene: SpaceTree, name: str, color: Color) -> None:
        super().__init__(scene, name, color)
        self.coloring: Scheme = Scheme.AUTO
        self._own_scheme = Scheme.COSTS if "costmap" in name else Scheme.MAP
        self._image: ImagePlane | None = None
        self._cells = np.zeros((0, 0), np.int8)
        self._scheme = Scheme.AUTO
        self._corners: npt.NDArray[np.floating] = np.zeros((0, 3))

    def draw(self, message: Any, appearance: Appearance) -> None:
        assert isinstance(message, OccupancyGrid)
        try:
            T_frame_origin = se3.from_pose(message.position_xyz, message.quat_xyzw)
        except ValueError as error:
            raise DamagedMessage(f"OccupancyGrid: {error}") from None
        if not (np.isfinite(T_frame_origin).all() and 0 < message.resolution < np.inf):
            raise DamagedMessage("OccupancyGrid: its origin or resolution is not a number")
        scheme = self._own_scheme if self.coloring is Scheme.AUTO else self.coloring
        if not message.cells.size:
            return
        image = self._paint(message.cells, scheme)
        size = np.array(message.cells.shape[::-1]) * message.resolution
        image.width, image.height = map(float, size)
        centre = np.append(size / 2, -depth_of(float(size.max()), scheme))
        move(image, T_frame_origin @ se3.from_parts(np.eye(3), centre))
        corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]) * np.append(size, 0)
        self._corners = se3.apply(T_frame_origin, corners)

    def extent(self) -> npt.NDArray[np.floating]:
        return self._corners

    def _paint(self, cells: npt.NDArray[np.int8], scheme: Scheme) -> ImagePlane:
        if (
            self._image is not None
            and scheme is self._scheme
            and np.array_equal(cells, self._cells)
        ):
            return self._image
        self._cells, self._scheme = cells, scheme
        picture = picture_of(cells, scheme)
        if self._image is None:
            self._image = self._scene.add(f"{self._name}/cells", ImagePlane())
        self._image.image = cv2.imencode(".png", picture[::-1, :, ::-1])[1].tobytes()
        return self._image


def picture_of(cells: npt.NDArray[np.int8], scheme: Scheme) -> Pixels:
    """A picture (H, W, 3) of cells (height, width): RGB, the first row that of the cells.

    Small maps are enlarged by a whole number; of large ones a pixel is the most occupied of the
    cells that it stands for, so that thin walls stay.
    """
    longer = max(cells.shape)
    pooled = _pool(cells, -(-longer // _MAX_PX))
    times = max(_SHARP_PX // longer, 1)
    picture: Pixels = palette_of(scheme).take(pooled.view(np.uint8), axis=0)
    if times > 1:
        picture = cv2.resize(picture, None, fx=times, fy=times, interpolation=cv2.INTER_NEAREST)
    return picture


def palette_of(scheme: Scheme) -> Pixels:
    """Colours (256, 3) of the cells' bytes, RGB; that of -1 is the last one.

    Source: the palettes of rviz's map display. Nothing is transparent in ours: pictures that lie
    over one another would hide each other's holes.
    """
    values = np.arange(256)
    palette = np.zeros((256, 3), np.uint8)
    palette[:101] = (255 - values[:101] * 255 // 100)[:, None]
    palette[101:128] = _BEYOND
    palette[128:255, 0] = 255
    palette[128:255, 1] = (values[128:255] - 128) * 255 // 126
    if scheme is Scheme.COSTS:
        red = values[1:99] * 255 // 100
        palette[1:99] = np.stack([red, np.zeros_like(red), 255 - red], axis=1)
        palette[99], palette[100] = _INSCRIBED, _LETHAL
    palette[255] = _UNKNOWN
    return palette


def depth_of(longer_m: float, scheme: Scheme) -> float:
    """Distance below its place at which a map is drawn, metres: larger ones lower, costs on top."""
    return _LAYER_M * (float(np.log2(1 + longer_m)) + (1 if scheme is Scheme.COSTS else 2))


def _pool(cells: npt.NDArray[np.int8], factor: int) -> npt.NDArray[np.int8]:
    """The greatest of each square of that many cells along its sides."""
    if factor == 1:
        return np.ascontiguousarray(cells)
    lacking = [(0, -length % factor) for length in cells.shape]
    padded = np.pad(cells, lacking, constant_values=-128)
    rows = padded.reshape(-1, factor, padded.shape[1]).max(axis=1)
    found: npt.NDArray[np.int8] = rows.reshape(len(rows), -1, factor).max(axis=2)
    return found

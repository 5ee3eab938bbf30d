"""The simulated world as markers, for the page, rviz and recordings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Header, Marker, MarkerArray, MarkerType
from ros_visualise.simulation.frames import DECK, MAP
from ros_visualise.simulation.pad import PAD
from ros_visualise.simulation.textures import BOARD_CELLS, Canvas

_PLANE, _SPHERE, _ELLIPSOID, _CYLINDER, _BOX = 0, 2, 4, 5, 6  # mjtGeom
_SOLIDS = {
    _SPHERE: MarkerType.SPHERE,
    _ELLIPSOID: MarkerType.SPHERE,
    _CYLINDER: MarkerType.CYLINDER,
    _BOX: MarkerType.CUBE,
}
_SHEET_M = 0.01  # thinner boxes are pictures: tags, helipads
_CELLS = 40  # of a picture along its side
_GROUND_M = 24.0  # drawn each way
_BELOW_M = 0.02  # below objects on the ground

Rgb = npt.NDArray[np.float32]


def scenery(model: Any, textures: Mapping[str, Canvas]) -> MarkerArray:
    """Everything but the robot: solids in their mean colours, and pictures.

    Static objects are in the frame ``map``, a landing pad in its own.

    Args:
        model: the ``mjModel``.
        textures: those of its materials.
    """
    return MarkerArray(tuple(_markers(model, textures)))


def _markers(model: Any, textures: Mapping[str, Canvas]) -> Iterator[Marker]:
    for geom in range(model.ngeom):
        kind, frame = int(model.geom_type[geom]), _frame_of(model, geom)
        is_ground = model.geom(geom).name == "ground"
        if frame is None or not (kind in _SOLIDS or is_ground):
            continue
        place = {
            "position_xyz": np.array(model.geom_pos[geom]),
            "quat_xyzw": np.roll(model.geom_quat[geom], -1),
            "id": geom,
            "header": Header(0, frame),
        }
        half, picture = np.array(model.geom_size[geom]), _picture(model, geom, textures)
        if is_ground:
            half = np.array([*np.minimum(half[:2], _GROUND_M), _BELOW_M / 4])
            place["position_xyz"] = np.array([0, 0, -_BELOW_M])
        if picture is not None and (is_ground or half[2] < _SHEET_M):
            yield _sheet(picture, half, place)
        else:
            yield _solid(kind, half, _color(model, geom, picture), place)


def _frame_of(model: Any, geom: int) -> str | None:
    """The frame of a geom; None for the robot's."""
    body = model.body(int(model.geom_bodyid[geom])).name
    return {"world": MAP, PAD: DECK}.get(body)


def _solid(kind: int, half: Floats, rgb: Rgb, place: dict[str, Any]) -> Marker:
    if kind == _SPHERE:
        half = np.full(3, half[0])
    elif kind == _CYLINDER:
        half = half[[0, 0, 1]]
    rgba = np.append(rgb, np.float32(1))
    type = _SOLIDS.get(kind, MarkerType.CUBE)
    return Marker(type, scale_xyz=2 * half, color_rgba=rgba, **place)


def _sheet(picture: Rgb, half: Floats, place: dict[str, Any]) -> Marker:
    """A picture as coloured cells; its upper edge is at +y, its left one at -x."""
    rows, columns = picture.shape[:2]
    size = 2 * half / [columns, rows, 1]
    x = (np.arange(columns) + 0.5) * size[0] - half[0]
    y = half[1] - (np.arange(rows) + 0.5) * size[1]
    grid = np.stack([*np.meshgrid(x, y), np.zeros((rows, columns))], axis=-1)
    rgba = np.concatenate([picture, np.ones((rows, columns, 1), np.float32)], axis=-1)
    return Marker(
        MarkerType.CUBE_LIST,
        scale_xyz=size,
        points_xyz=grid.reshape(-1, 3),
        colors_rgba=rgba.reshape(-1, 4),
        **place,
    )


def _picture(model: Any, geom: int, textures: Mapping[str, Canvas]) -> Rgb | None:
    """The texture of a geom, reduced to (rows, columns, 3) from 0 to 1; None without one."""
    material = int(model.geom_matid[geom])
    name = "" if material < 0 else model.mat(material).name
    if name not in textures:
        return None
    side = BOARD_CELLS if name.startswith("tag_") else _CELLS
    if model.mat_texuniform[material]:
        side = 1  # repeated: only its mean colour matters
    small = cv2.resize(textures[name], (side, side), interpolation=cv2.INTER_AREA)
    return np.asarray(small / 255, np.float32)


def _color(model: Any, geom: int, picture: Rgb | None) -> Rgb:
    if picture is None:
        return np.array(model.geom_rgba[geom][:3], np.float32)
    return np.asarray(picture.mean(axis=(0, 1)), np.float32)

"""Rays cast by MuJoCo, at a cost that does not grow with the world.

``mj_multiRay`` looks at every geom of a model for every ray. So rays are cast sector by sector of
azimuth, each in a model that holds the few geoms of that sector alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.simulation.engine import load_mujoco

Indices = npt.NDArray[np.intp]
_SHOWN, _HIDDEN = 0, 1  # groups of geoms
_ANYWHERE = [0.0, 0.0, 0.0, 1e6, 1e6, 1e6]  # of bounding boxes: middle and half sides
_ALL_SHOWN = np.array([1, 0, 0, 0, 0, 0], np.uint8)


class RayCaster:
    """Casts rays at geoms that do not move.

    Args:
        model: the whole world's.
        data: of it, with positions up to date.
        geoms: (G,) their numbers in it.
    """

    def __init__(self, model: Any, data: Any, geoms: Indices) -> None:
        self._mujoco = load_mujoco()
        self._shapes = (
            model.geom_type[geoms],
            model.geom_size[geoms],
            model.geom_aabb[geoms],
            model.geom_rbound[geoms],
        )
        self._places, self._axes = data.geom_xpos[geoms], data.geom_xmat[geoms]
        self._stages: dict[int, tuple[Any, Any]] = {}

    def cast(
        self, position_xyz: Floats, rays: Floats, among: Indices, far_m: float
    ) -> tuple[Floats, Indices]:
        """Ranges in metres and what was met, (N,) each; -1 where nothing was.

        Args:
            rays: (N, 3) of length 1, in the world.
            among: (M,) which of the geoms to look at, by their places in the list.
        """
        model, data = self._set(among)
        count = len(rays)
        met, ranges = np.empty(count, np.int32), np.empty(count)
        self._mujoco.mj_multiRay(
            model,
            data,
            position_xyz,
            rays.ravel(),
            _ALL_SHOWN,
            1,
            -1,
            met,
            ranges,
            None,
            count,
            far_m,
        )
        return ranges, np.where(met < 0, -1, among[met])

    def _set(self, among: Indices) -> tuple[Any, Any]:
        """A model of a few geoms more than that, these among them and the others hidden."""
        count = len(among)
        room = 1 << max(count - 1, 3).bit_length()
        if room not in self._stages:
            self._stages[room] = self._build(room)
        model, data = self._stages[room]
        types, sizes, boxes, bounds = self._shapes
        model.geom_type[:count], model.geom_size[:count] = types[among], sizes[among]
        model.geom_aabb[:count], model.geom_rbound[:count] = boxes[among], bounds[among]
        data.geom_xpos[:count], data.geom_xmat[:count] = self._places[among], self._axes[among]
        model.geom_group[:count], model.geom_group[count:] = _SHOWN, _HIDDEN
        return model, data

    def _build(self, room: int) -> tuple[Any, Any]:
        geoms = '<geom size="1"/>' * room
        xml = f"<mujoco><worldbody>{geoms}</worldbody></mujoco>"
        model = self._mujoco.MjModel.from_xml_string(xml)
        model.bvh_aabb[:] = _ANYWHERE
        data = self._mujoco.MjData(model)
        self._mujoco.mj_forward(model, data)
        return model, data

"""Many copies of one solid in one node of the scene."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np
import numpy.typing as npt
import viser

from ros_visualise.data import Floats
from ros_visualise.geometry import transforms
from ros_visualise.ui.scene.drawing import to_wxyz

Placed = tuple[Floats, Floats, npt.NDArray[np.floating]]
"""T (N, 4, 4), scales (N, 3) and rgba (N, 4) from 0 to 1."""

_Rows = npt.NDArray[np.float32]
_PLACE, _TURN, _SIZE, _RGB, _ALPHA = slice(0, 3), slice(3, 7), slice(7, 10), slice(10, 13), 13
_COLUMNS = 14


class SolidBatch:
    """Copies that may each have a size and a colour of their own, some under each of many keys.

    Args:
        scene: where to draw.
        name: of the node.
        vertices: (V, 3) of the solid.
        faces: (F, 3) of the solid.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        name: str,
        vertices: npt.NDArray[np.float32],
        faces: npt.NDArray[np.uint32],
    ) -> None:
        self._scene, self._name = scene, name
        self._vertices, self._faces = vertices, faces
        self._handle: viser.BatchedMeshHandle | None = None
        self._shape: tuple[int, bool] = (0, False)
        self._new: dict[Hashable, Placed] = {}
        self._parts: dict[Hashable, _Rows] = {}  # each a view of the rows of all
        self._rows: _Rows = np.zeros((0, _COLUMNS), np.float32)
        self._is_other = False  # how many copies there are under some key

    def put(self, key: Hashable, part: Placed) -> None:
        """Have these copies under a key, and no others, from the next `show` on."""
        self._new[key] = part

    def drop(self, key: Hashable) -> None:
        """Have none under a key from the next `show` on."""
        self._new.pop(key, None)
        if self._parts.pop(key, None) is not None:
            self._is_other = True

    def show(self) -> None:
        """Draw what was put; those that cannot be seen are left out."""
        if not self._new and not self._is_other:
            return
        for key, rows in zip(self._new, _rows_of(list(self._new.values())), strict=True):
            self._set(key, rows)
        self._new.clear()
        if self._is_other:
            self._gather()
        self._draw()

    def _set(self, key: Hashable, rows: _Rows) -> None:
        there = self._parts.get(key)
        if there is not None and len(there) == len(rows):
            there[:] = rows
        else:
            self._parts[key], self._is_other = rows, True

    def _gather(self) -> None:
        """Put the rows of all keys one after the other."""
        empty = np.zeros((0, _COLUMNS), np.float32)
        self._rows = np.concatenate([empty, *self._parts.values()])
        ends = np.cumsum([len(rows) for rows in self._parts.values()], dtype=int)
        for key, end in zip(self._parts, ends, strict=True):
            self._parts[key] = self._rows[end - len(self._parts[key]) : end]
        self._is_other = False

    def _draw(self) -> None:
        """Change the node in place, or make another where it cannot be changed so."""
        rows = self._rows
        is_clear = bool((rows[:, _ALPHA] < 1).any())
        if (len(rows), is_clear) != self._shape and self._handle is not None:
            self._handle.remove()
            self._handle = None
        self._shape = len(rows), is_clear
        if not len(rows):
            return
        colors = np.round(rows[:, _RGB] * 255).astype(np.uint8)
        if self._handle is None:
            self._handle = self._scene.add_batched_meshes_simple(
                self._name,
                self._vertices,
                self._faces,
                rows[:, _TURN].copy(),
                rows[:, _PLACE].copy(),
                batched_scales=rows[:, _SIZE].copy(),
                batched_colors=colors,
                batched_opacities=rows[:, _ALPHA].copy() if is_clear else None,
                lod="off",
            )
            return
        node = self._handle
        node.batched_wxyzs, node.batched_positions = rows[:, _TURN], rows[:, _PLACE]
        node.batched_scales, node.batched_colors = rows[:, _SIZE], colors
        if is_clear:
            node.batched_opacities = rows[:, _ALPHA]


def _rows_of(parts: Sequence[Placed]) -> list[_Rows]:
    """A row for each copy that can be seen, part by part: all are converted at once."""
    T = np.concatenate([np.zeros((0, 4, 4)), *(part[0] for part in parts)])
    positions, quats_xyzw = transforms.to_pose(T)
    rows = np.empty((len(T), _COLUMNS), np.float32)
    rows[:, _PLACE], rows[:, _TURN] = positions, to_wxyz(quats_xyzw)
    rows[:, _SIZE] = np.concatenate([np.zeros((0, 3)), *(part[1] for part in parts)])
    rgba = np.concatenate([np.zeros((0, 4)), *(part[2] for part in parts)])
    rows[:, _RGB.start :] = np.clip(rgba, 0, 1)
    ends = np.cumsum([len(part[0]) for part in parts], dtype=int)[:-1]
    return [one[one[:, _ALPHA] > 0] for one in np.split(rows, ends)] if parts else []

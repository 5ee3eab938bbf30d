"""Many copies of one solid in one node of the scene."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import viser

from ros_visualise.data import Floats
from ros_visualise.geometry import transforms
from ros_visualise.ui.scene.drawing import to_wxyz

Placed = tuple[Floats, Floats, npt.NDArray[np.floating]]
"""T (N, 4, 4), scales (N, 3) and rgba (N, 4) from 0 to 1."""


class SolidBatch:
    """Copies that may each have a size and a colour of their own.

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

    def show(self, parts: Sequence[Placed]) -> None:
        """Draw these copies and no others; those that cannot be seen are left out."""
        T = np.concatenate([np.zeros((0, 4, 4)), *(part[0] for part in parts)])
        scales = np.concatenate([np.zeros((0, 3)), *(part[1] for part in parts)])
        rgba = np.clip(np.concatenate([np.zeros((0, 4)), *(part[2] for part in parts)]), 0, 1)
        seen = rgba[:, 3] > 0
        self._show(T[seen], scales[seen], rgba[seen])

    def _show(self, T: Floats, scales: Floats, rgba: Floats) -> None:
        is_clear = bool((rgba[:, 3] < 1).any())
        shape = len(T), is_clear
        if shape != self._shape and self._handle is not None:
            self._handle.remove()
            self._handle = None
        self._shape = shape
        if not len(T):
            return
        positions, quats_xyzw = transforms.to_pose(T)
        wxyzs, places = to_wxyz(quats_xyzw).astype(np.float32), positions.astype(np.float32)
        colors = np.round(rgba[:, :3] * 255).astype(np.uint8)
        sizes, alphas = scales.astype(np.float32), rgba[:, 3].astype(np.float32)
        if self._handle is None:
            self._handle = self._scene.add_batched_meshes_simple(
                self._name,
                self._vertices,
                self._faces,
                wxyzs,
                places,
                batched_scales=sizes,
                batched_colors=colors,
                batched_opacities=alphas if is_clear else None,
                lod="off",
            )
            return
        self._handle.batched_wxyzs, self._handle.batched_positions = wxyzs, places
        self._handle.batched_scales, self._handle.batched_colors = sizes, colors
        if is_clear:
            self._handle.batched_opacities = alphas

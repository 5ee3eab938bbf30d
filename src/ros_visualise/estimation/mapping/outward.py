"""Bias of a detector that sees tags larger or smaller than they are."""

from __future__ import annotations

import numpy as np

from ros_visualise.data import Floats


def outward_steps(corners_uv: Floats) -> Floats:
    """(..., 4, 2) shift of corners when each side of a square moves outward by half a pixel.

    Args:
        corners_uv: (..., 4, 2) pixels, in order around squares.
    """
    forth = np.roll(corners_uv, -1, axis=-2) - corners_uv
    forth = forth / np.linalg.norm(forth, axis=-1, keepdims=True)
    back = -np.roll(forth, 1, axis=-2)
    sine = np.abs(forth[..., 0] * back[..., 1] - forth[..., 1] * back[..., 0])
    steps: Floats = -(forth + back) / (2 * np.maximum(sine, 0.1))[..., None]
    return steps

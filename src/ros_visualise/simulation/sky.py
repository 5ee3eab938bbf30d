"""The sky over a simulated world, and the hills at its rim."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

Canvas = npt.NDArray[np.uint8]
Array = npt.NDArray[np.float32]

FACES = "RLUDFB"
"""The order of the faces on `draw_sky`'s picture, as ``gridlayout`` of MJCF names them."""


def draw_sky(side: int = 384) -> Canvas:
    """Six faces of a cube side by side, RGB, (side, 6 * side, 3)."""
    return np.concatenate([_draw_face(_directions(face, side)) for face in FACES], axis=1)


def _directions(face: str, side: int) -> Array:
    """The directions of a face's pixels in the world, (side, side, 3), z up.

    MuJoCo's cube is OpenGL's, which has y up, turned so that its front is towards y.
    """
    a = (np.arange(side, dtype=np.float32) + 0.5) / side * 2 - 1
    right, down = np.meshgrid(a, a)
    one = np.ones_like(right)
    axes = {
        "R": (one, right, -down),
        "L": (-one, -right, -down),
        "U": (right, down, one),
        "D": (right, -down, -one),
        "F": (right, -one, -down),
        "B": (-right, one, -down),
    }
    direction = np.stack(axes[face], axis=-1)
    return np.asarray(direction / np.linalg.norm(direction, axis=-1, keepdims=True), np.float32)


def _draw_face(direction: Array) -> Canvas:
    height = direction[..., 2]
    azimuth = np.arctan2(direction[..., 1], direction[..., 0])
    blue, pale = np.array((86, 140, 208)), np.array((206, 222, 236))
    sky = pale + (blue - pale) * np.clip(height, 0, 1)[..., None] ** 0.55
    sky += (np.array((250, 250, 250)) - sky) * _clouds(direction)[..., None]
    for distance, colour, level, steep in _HILLS:
        ridge = level + steep * _ridge(azimuth, distance)
        edge = np.clip((ridge - height) * 350, 0, 1)[..., None]
        sky += (np.array(colour) - sky) * edge
    return np.asarray(np.clip(sky, 0, 255), np.uint8)


_HILLS = (
    (3, (166, 186, 204), 0.060, 0.035),
    (5, (132, 158, 158), 0.034, 0.024),
    (11, (92, 118, 84), 0.014, 0.010),
)


def _ridge(azimuth: Array, waves: int) -> Array:
    a = waves * azimuth
    return np.asarray(
        0.5 * np.sin(a) + 0.3 * np.sin(2 * a + waves) + 0.2 * np.sin(5 * a + 2 * waves)
    )


def _clouds(direction: Array) -> Array:
    """The density of clouds: noise on a flat layer, thinner towards the horizon."""
    layer = np.random.default_rng(2).uniform(0, 1, (64, 64)).astype(np.float32)
    height = np.maximum(direction[..., 2], 0.03)
    x, y = direction[..., 0] / height, direction[..., 1] / height
    amount = np.zeros_like(height)
    for octave, weight in ((1.1, 0.5), (2.3, 0.28), (4.9, 0.14), (10.1, 0.08)):
        u, v = np.mod(octave * x + 17, 63), np.mod(octave * y + 29, 63)
        amount += weight * cv2.remap(layer, u, v, cv2.INTER_LINEAR)
    clear = np.clip(direction[..., 2] * 5 - 0.25, 0, 1)
    return np.asarray(np.clip((amount - 0.5) * 4.5, 0, 0.9) * clear, np.float32)

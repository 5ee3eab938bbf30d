"""Pictures of tags whose corners are known, as a camera takes them: antialiased, blurred, noisy."""

from __future__ import annotations

import cv2
import numpy as np

FINER = 8
"""The picture is drawn so many times finer, and averaged."""


def side_to_side(
    cells: np.ndarray, border: int, rng: np.random.Generator, side_px: float, tilt: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """A tag turned at random, its middle somewhere within a pixel.

    Args:
        cells: (N, N), 1 is white, with all that is printed around the tag's square.
        border: cells between the edge of the picture and the tag's square.
        rng: whose seed makes the picture.
        side_px: of the tag's square, seen from the front.
        tilt: about a random axis in its plane, radians; at 8 times its side away.

    Returns:
        The picture, and its corners (4, 2): lower left, lower right, upper right, upper left.
    """
    size = int(side_px * 1.8) + 24
    corners = seen_corners(rng, side_px, tilt) + size / 2 + rng.uniform(-0.5, 0.5, 2)
    return draw(cells, border, corners, (size, size), rng), corners


def seen_corners(rng: np.random.Generator, side_px: float, tilt: float) -> np.ndarray:
    """Corners (4, 2) about the middle, of a tag that is turned and tilted."""
    turn, axis = rng.uniform(0, 2 * np.pi, 2)
    across = cv2.Rodrigues(np.array([0, 0, turn]))[0]
    over = cv2.Rodrigues(tilt * np.array([np.cos(axis), np.sin(axis), 0]))[0]
    half = side_px / 2
    square = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])
    seen = square @ (over @ across).T
    return seen[:, :2] / (1 + seen[:, 2:] / (8 * side_px))


def draw(
    cells: np.ndarray,
    border: int,
    corners: np.ndarray,
    size: tuple[int, int],
    rng: np.random.Generator,
    blur: float = 0.7,
    noise: float = 2.5,
) -> np.ndarray:
    """A picture of ``size`` (width, height) with the tag's square at these corners.

    Gray levels are 30 and 220 on 128; the blur is a Gaussian's standard deviation in pixels.
    """
    last = len(cells) - border
    square = np.array([[border, last], [last, last], [last, border], [border, border]])
    to_fine = FINER * (corners + 0.5) - 0.5  # origins are centres of pixels
    H = cv2.getPerspectiveTransform(np.float32(square * 16 - 0.5), np.float32(to_fine))
    levels = np.kron(np.where(cells, 220, 30).astype(np.uint8), np.ones((16, 16), np.uint8))
    image = np.full(size[::-1], 128, np.float32)
    left, top, right, bottom = _around(H, len(levels), size)
    fine = np.full((FINER * (bottom - top), FINER * (right - left)), 128, np.uint8)
    moved = np.array([[1, 0, -FINER * left], [0, 1, -FINER * top], [0, 0, 1]]) @ H
    cv2.warpPerspective(
        levels, moved, fine.shape[::-1], fine, cv2.INTER_NEAREST, borderMode=cv2.BORDER_TRANSPARENT
    )
    drawn = cv2.resize(fine, (right - left, bottom - top), interpolation=cv2.INTER_AREA)
    image[top:bottom, left:right] = drawn
    image = cv2.GaussianBlur(image, (0, 0), blur) + rng.normal(0, noise, image.shape)
    return np.clip(image.round(), 0, 255).astype(np.uint8)


def _around(H: np.ndarray, side: int, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """Left, top, right and bottom of the pixels that show anything of what H draws."""
    ends = np.float32([[[0, 0], [side, 0], [side, side], [0, side]]])
    shown = cv2.perspectiveTransform(ends, H)[0] / FINER
    left, top = np.clip(np.floor(shown.min(axis=0)) - 1, 0, np.subtract(size, 1)).astype(int)
    right, bottom = np.clip(np.ceil(shown.max(axis=0)) + 2, (left + 1, top + 1), size).astype(int)
    return left, top, right, bottom

"""Landmarks that nobody could recognise count as not visible."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from grounds import Canvas
from outlines import Array
from shots import Seen
from worlds import CLASSES

_LEAST_DIFFERENCE, _LEAST_CONTRAST, _LEAST_COLOUR = 12.0, 8.0, 16.0  # gray levels
_MIDDLE = 0.6  # of an outline's size, where the letter or the cells are
_FLATTEST, _ROUNDEST = 6.0, 1.5  # the longer side by the shorter one
_NARROWEST = {"helipad": 20.0, "tag": 10.0, "post": 2.0}
"""Pixels: the strokes of a narrower pad's letter and the cells of a tag are thinner than one, and
a thinner post is a scratch."""


def judge(seen: Seen, picture: Canvas, bare: Canvas) -> Seen:
    """The landmark; where nobody could tell it, the share of it that is seen is negative.

    Args:
        picture: RGB, as the camera gives it.
        bare: the same without any landmark; blur, light, colours and noise are the same.
    """
    name = CLASSES[seen.kind] if seen.kind < len(CLASSES) else ""
    hidden = difference(seen.box, picture, bare) < _LEAST_DIFFERENCE
    hidden = hidden or seen.sides[1] < _NARROWEST.get(name, 0.0)
    if name in ("helipad", "tag"):
        flat = seen.sides[0] > _FLATTEST * seen.sides[1]
        hidden = hidden or flat or contrast(seen.hull, picture) < _LEAST_CONTRAST
    if name == "post":
        hidden = hidden or seen.sides[0] < _ROUNDEST * seen.sides[1]
        hidden = hidden or colour(seen.box, picture, bare) < _LEAST_COLOUR
    if name in ("helipad", "post"):
        hidden = hidden or _is_outside(seen.point, picture)
    return replace(seen, share=-seen.share) if hidden else seen


def difference(box: Array, picture: Canvas, bare: Canvas) -> float:
    """Change of the picture by a landmark: root mean square over its box, gray levels."""
    a, b = (_smooth(_part(box, each)) for each in (picture, bare))
    return float(np.sqrt(np.mean((a - b) ** 2)))


def contrast(hull: Array, picture: Canvas) -> float:
    """Standard deviation of the gray levels in the middle of an outline, where the pattern is."""
    whole = cv2.moments(hull.astype(np.float32))
    middle = np.array([whole["m10"], whole["m01"]]) / whole["m00"]
    inner = middle + _MIDDLE * (hull - middle)
    box = np.concatenate([inner.min(axis=0), inner.max(axis=0)])
    gray = _smooth(cv2.cvtColor(_part(box, picture), cv2.COLOR_RGB2GRAY))
    mask = np.zeros(gray.shape, np.uint8)
    corners = inner - np.maximum(np.floor(box[:2]), 0)
    cv2.fillConvexPoly(mask, np.round(corners).astype(np.int32), 1)
    return float(gray[mask > 0].std())


def colour(box: Array, picture: Canvas, bare: Canvas) -> float:
    """Colourfulness of a landmark: highest channel minus the lowest one, gray levels.

    Of the changed pixels of its box, the most colourful quarter has at least that.
    """
    a, b = (_smooth(_part(box, each)) for each in (picture, bare))
    changed = np.abs(a - b).max(axis=2) > _LEAST_DIFFERENCE
    return float(np.percentile(np.ptp(a, axis=2)[changed], 75)) if changed.any() else 0.0


def _is_outside(point: Array, picture: Canvas) -> bool:
    """True if a point, u and v in pixels, is outside the picture."""
    return bool((point < 0).any() or (point > np.array(picture.shape[1::-1]) - 1).any())


def _part(box: Array, picture: Canvas) -> Canvas:
    """The pixels of a box."""
    low = np.maximum(np.floor(box[:2]), 0).astype(int)
    high = np.ceil(box[2:]).astype(int) + 1
    return picture[low[1] : high[1], low[0] : high[0]]


def _smooth(part: Canvas) -> Array:
    """Without the grain of single pixels."""
    return np.asarray(cv2.blur(part.astype(np.float32), (3, 3)), np.float64)

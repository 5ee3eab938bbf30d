"""Pictures of measurements, such as depth."""

from __future__ import annotations

import cv2
import numpy as np

from ros_visualise.data import Pixels

_SHOWN = (2, 98)  # percentiles: what lies outside has the colours of the ends
_MIDDLE = 128.0  # level of an image that is the same everywhere
_SAMPLES = 100  # along each side, enough for percentiles


def _make_colors() -> Pixels:
    levels = np.arange(256, dtype=np.uint8).reshape(256, 1)
    colors: Pixels = cv2.applyColorMap(levels, cv2.COLORMAP_TURBO)
    colors[0] = 0
    return colors


_COLORS = _make_colors()


def to_picture(values: Pixels) -> Pixels:
    """Values as bgr8: low ones blue, high ones red, black where there are none.

    Zero and what is no finite number count as none (REP 118). The scale is that of the image
    itself, without its extremes. Of two channels their length is shown; three or more are taken
    for blue, green and red.

    Args:
        values: (height, width) or (height, width, channels) of any type.

    Source of the colours: A. Mikhailov, Turbo, An Improved Rainbow Colormap, 2019.
    """
    if not values.size:
        return np.zeros((*values.shape[:2], 3), np.uint8)
    if values.ndim == 2:
        return cv2.applyColorMap(_to_levels(values), _COLORS)
    if values.shape[2] == 2:
        return to_picture(np.hypot(values[..., 0], values[..., 1], dtype=np.float64))
    height, width = values.shape[:2]
    colors = np.ascontiguousarray(values[..., :3])
    return _to_levels(colors.reshape(height, -1)).reshape(height, width, 3)


def _to_levels(values: Pixels) -> Pixels:
    """1 to 255, and 0 where there is no value."""
    is_value = values != 0
    if values.dtype.kind == "f":
        is_value &= np.isfinite(values)
    low, high = _range(values)
    slope = 254 / (high - low) if high > low else 0.0
    offset = 1 - low * slope if slope else _MIDDLE
    levels = cv2.addWeighted(values, slope, values, 0, offset, dtype=cv2.CV_8U)
    return np.where(is_value, np.maximum(levels, 1), np.uint8(0))


def _range(values: Pixels) -> tuple[float, float]:
    steps = (max(1, side // _SAMPLES) for side in values.shape)
    sample = values[tuple(slice(None, None, step) for step in steps)]
    sample = sample[(sample != 0) & np.isfinite(sample)]
    if not sample.size:
        return 0.0, 0.0
    low, high = np.percentile(sample, _SHOWN)
    return float(low), float(high)

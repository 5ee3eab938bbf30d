"""Pictures and colours of measurements, such as depth."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Pixels

Values = npt.NDArray[np.floating]

_USUAL = (2, 98)  # percentiles
_MIDDLE = 128.0  # level of an image with one value only
_SAMPLES = 100  # along each side of an image
_LEVELS = np.arange(256, dtype=np.uint8).reshape(256, 1)
_TURBO: Pixels = cv2.applyColorMap(_LEVELS, cv2.COLORMAP_TURBO)
_TURBO_OR_BLACK: Pixels = np.concatenate([np.zeros_like(_TURBO[:1]), _TURBO[1:]])


def turbo(values: Values, low: float, high: float) -> Pixels:
    """Colours (N, 3) uint8, RGB, from blue at ``low`` to red at ``high``; NaN counts as low.

    Source: A. Mikhailov, Turbo, An Improved Rainbow Colormap, 2019.
    """
    scale = 255 / max(high - low, 1e-9)
    steps = np.nan_to_num(np.clip((values - low) * scale, 0, 255), copy=False)
    colors: Pixels = _TURBO[steps.astype(np.uint8), 0, ::-1]
    return colors


def usual_range(values: Values) -> tuple[float, float] | None:
    """The range of most values, without outliers; None if none is finite."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return None
    low, high = np.percentile(finite, _USUAL)
    return float(low), float(high)


def to_picture(values: Pixels) -> Pixels:
    """Values as bgr8: low ones blue, high ones red, missing ones black.

    Zero, NaN and infinities count as missing (REP 118). The scale spans the usual range of the
    image. Two channels are shown by their length; three or more as blue, green and red.

    Args:
        values: (height, width) or (height, width, channels) of any type.
    """
    if not values.size:
        return np.zeros((*values.shape[:2], 3), np.uint8)
    if values.ndim == 2:
        return cv2.applyColorMap(_to_levels(values), _TURBO_OR_BLACK)
    if values.shape[2] == 2:
        return to_picture(np.hypot(values[..., 0], values[..., 1], dtype=np.float64))
    height, width = values.shape[:2]
    colors = np.ascontiguousarray(values[..., :3])
    return _to_levels(colors.reshape(height, -1)).reshape(height, width, 3)


def _to_levels(values: Pixels) -> Pixels:
    """Levels 1 to 255, and 0 where the value is missing."""
    is_value = values != 0
    if values.dtype.kind == "f":
        is_value &= np.isfinite(values)
    steps = (max(1, side // _SAMPLES) for side in values.shape)
    sample = values[tuple(slice(None, None, step) for step in steps)]
    low, high = usual_range(sample[sample != 0]) or (0.0, 0.0)
    slope = 254 / (high - low) if high > low else 0.0
    offset = 1 - low * slope if slope else _MIDDLE
    levels = cv2.addWeighted(values, slope, values, 0, offset, dtype=cv2.CV_8U)
    return np.where(is_value, np.maximum(levels, 1), np.uint8(0))

"""The colours of points: their own, or by what was measured at them."""

from __future__ import annotations

from enum import Enum

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Pixels, PointCloud
from ros_visualise.ui.colors import Color

_RGB = ("rgb", "rgba")
_INTENSITY = ("intensity", "intensities", "reflectivity", "i")
_SAMPLE = 4096
_OUTLIERS = 2  # percent at either end


class Coloring(Enum):
    """By what points are coloured; ``AUTO`` is the first of rgb, intensity and height there is."""

    AUTO = "auto"
    RGB = "rgb"
    INTENSITY = "intensity"
    HEIGHT = "height"
    PLAIN = "plain"


_TURBO: Pixels = cv2.cvtColor(
    cv2.applyColorMap(np.arange(256, dtype=np.uint8), cv2.COLORMAP_TURBO), cv2.COLOR_BGR2RGB
).reshape(256, 3)


def turbo(values: npt.NDArray[np.floating], low: float, high: float) -> Pixels:
    """Colours (N, 3) uint8, RGB, from blue at ``low`` to red at ``high``; no number is low."""
    scale = 255 / max(high - low, 1e-9)
    steps = np.nan_to_num(np.clip((values - low) * scale, 0, 255), copy=False)
    colors: Pixels = _TURBO[steps.astype(np.uint8)]
    return colors


def usual_range(values: npt.NDArray[np.floating]) -> tuple[float, float]:
    """From where to where most values are, outliers left out."""
    sample = values[:: max(len(values) // _SAMPLE, 1)]
    sample = sample[np.isfinite(sample)]
    if not len(sample):
        return 0.0, 1.0
    low, high = np.percentile(sample, (_OUTLIERS, 100 - _OUTLIERS))
    return float(low), float(high)


def colors_of(
    cloud: PointCloud,
    points: npt.NDArray[np.void],
    heights: npt.NDArray[np.floating],
    coloring: Coloring,
    plain: Color,
) -> Pixels:
    """Colours of some of a cloud's points: (N, 3) uint8, RGB, or (3,) where all have the same.

    Args:
        cloud: whose points.
        points: (N,) of them, in its layout.
        heights: (N,) metres upwards in the fixed frame.
        coloring: by what; what the cloud lacks is left for the next thing that it has.
        plain: the colour of all, where asked for.
    """
    names = cloud.points.dtype.names or ()
    if coloring is Coloring.PLAIN:
        return np.array(plain, np.uint8)
    if coloring in (Coloring.AUTO, Coloring.RGB):
        found = _own_colors(points, names)
        if found is not None:
            return found
    if coloring is not Coloring.HEIGHT:
        field = next((name for name in names if name.lower() in _INTENSITY), None)
        if field is not None:
            values = points[field].astype(np.float32)
            return turbo(values, *usual_range(values))
    return turbo(heights, *usual_range(heights))


def heights_of(xyz: npt.NDArray[np.floating], T_fixed_frame: Floats) -> npt.NDArray[np.floating]:
    """How high points (N, 3) are in the fixed frame, metres: (N,)."""
    row = T_fixed_frame[2].astype(xyz.dtype)
    heights: npt.NDArray[np.floating] = xyz @ row[:3] + row[3]
    return heights


def _own_colors(points: npt.NDArray[np.void], names: tuple[str, ...]) -> Pixels | None:
    """As PCL packs them, 0x00RRGGBB in four bytes, or in a field for each."""
    packed = next((name for name in names if name in _RGB), None)
    if packed is not None and points.dtype[packed].itemsize == 4:
        words = np.ascontiguousarray(points[packed]).view(np.uint32)
        return np.stack([words >> 16 & 255, words >> 8 & 255, words & 255], axis=1).astype(np.uint8)
    if {"r", "g", "b"} <= set(names):
        colors = np.stack([points[name] for name in "rgb"], axis=1)
        if colors.dtype.kind == "f":
            colors = colors * 255 if np.nanmax(colors, initial=0) <= 1 else colors
        own: Pixels = np.nan_to_num(np.clip(colors, 0, 255)).astype(np.uint8)
        return own
    return None

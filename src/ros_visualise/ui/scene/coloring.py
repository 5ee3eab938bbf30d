"""The colours of points: their own, or by what was measured at them."""

from __future__ import annotations

from enum import Enum

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Pixels, PointCloud
from ros_visualise.plotting.colors import Color
from ros_visualise.vision.measurements import turbo, usual_range

_RGB = ("rgb", "rgba")
_INTENSITY = ("intensity", "intensities", "reflectivity", "i")
_SAMPLE = 4096


class Coloring(Enum):
    """Colour schemes of points; ``AUTO`` is the first of RGB, intensity and height available."""

    AUTO = "Auto"
    RGB = "RGB"
    INTENSITY = "Intensity"
    HEIGHT = "Height"
    PLAIN = "Single colour"


def by_value(values: npt.NDArray[np.floating]) -> Pixels:
    """Colours (N, 3) uint8, RGB: from blue to red over the usual range of the values."""
    sample = values[:: max(len(values) // _SAMPLE, 1)]
    return turbo(values, *(usual_range(sample) or (0.0, 1.0)))


def colors_of(
    cloud: PointCloud,
    points: npt.NDArray[np.void],
    heights: npt.NDArray[np.floating],
    coloring: Coloring,
    plain: Color,
) -> Pixels:
    """Colours of some of a cloud's points: (N, 3) uint8, RGB, or (3,) where all have the same.

    Args:
        points: (N,) of the cloud, in its layout.
        heights: (N,) metres upwards in the fixed frame.
        coloring: the scheme; one that the cloud has no field for is replaced by the next.
        plain: the single colour.
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
            return by_value(points[field].astype(np.float32))
    return by_value(heights)


def heights_of(xyz: npt.NDArray[np.floating], T_fixed_frame: Floats) -> npt.NDArray[np.floating]:
    """Heights (N,) of points (N, 3) in the fixed frame, metres."""
    row = T_fixed_frame[2].astype(xyz.dtype)
    heights: npt.NDArray[np.floating] = xyz @ row[:3] + row[3]
    return heights


def _own_colors(points: npt.NDArray[np.void], names: tuple[str, ...]) -> Pixels | None:
    """Colours as PCL packs them, 0x00RRGGBB in four bytes, or in a field for each."""
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

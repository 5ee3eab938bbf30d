"""Lenses of common cameras by their fields of view, for images without a calibration.

Their centres are those of the image, and they have no distortion but that of a fisheye, whose
angles are proportional to distances from the centre: calibrate a camera if a few per cent matter.

Source: the makers' data sheets: focal lengths as of 36 x 24 mm, by the diagonal, for cameras of
drones; horizontal fields of view of others.
"""

from __future__ import annotations

import math

import numpy as np

from ros_visualise.core.errors import ParameterError, did_you_mean
from ros_visualise.data import CameraInfo
from ros_visualise.vision.reshape import Size

_DIAGONAL_MM = math.hypot(36, 24)
_WIDEST = 1.55
_LEAST_DEG, _MOST_DEG = 1.0, 170.0

_FOCAL_MM = {
    **dict.fromkeys(("FC300C", "FC300S", "FC300X", "FC330", "FC350", "FC6510"), 20.0),
    **dict.fromkeys(("FC3411", "FC6520"), 22.0),
    **dict.fromkeys(("FC2103", "FC3170", "FC3582", "FC6310", "FC6310S", "FC7203", "FC7303"), 24.0),
    **dict.fromkeys(("FC6310R", "FC8482", "L2D-20C", "M3E", "M3M", "M3T"), 24.0),
    **{"FC1102": 25.0, "FC220": 26.0, "L1D-20C": 28.0},
    **dict.fromkeys(("PHANTOM 3", "PHANTOM 4", "INSPIRE 1"), 20.0),
    **dict.fromkeys(("PHANTOM 4 PRO", "MAVIC 3", "MAVIC AIR", "MAVIC AIR 2", "MAVIC MINI"), 24.0),
    **dict.fromkeys(("MINI 2", "MINI 3", "MINI 3 PRO", "MINI 4 PRO"), 24.0),
    **{"AIR 2S": 22.0, "SPARK": 25.0, "MAVIC PRO": 26.0, "MAVIC 2 PRO": 28.0, "ANAFI": 23.0},
}
"""Camera or drone -> focal length as of 36 x 24 mm, of the whole image."""
_WIDTH_DEG = {
    **{"RASPBERRY PI 1": 53.5, "RASPBERRY PI 2": 62.2, "RASPBERRY PI 3": 66.0},
    **{"C920": 70.4, "D435": 69.4, "D455": 90.0},
}
"""Camera -> horizontal field of view, degrees."""
_FISHEYE_DEG = {"GOPRO WIDE": 118.2}
"""Camera with a fisheye -> horizontal field of view, degrees."""

NAMES = tuple(name.lower() for name in (*_FOCAL_MM, *_WIDTH_DEG, *_FISHEYE_DEG))


def find_lens(text: str, size: Size) -> CameraInfo:
    """The lens that a person names, for images of a size.

    Args:
        text: a camera of the table, or a horizontal field of view in degrees.
        size: width and height, pixels.

    Raises:
        ParameterError: neither.
    """
    found = lens_of_model(text, size)
    if found is not None:
        return found
    try:
        degrees = float(text)
    except ValueError:
        hint = did_you_mean(text.lower(), NAMES, listed=False)
        raise ParameterError(
            f"lens={text!r}: give a horizontal field of view in degrees, or a camera, such as"
            f" mini 2{hint}"
        ) from None
    if not _LEAST_DEG <= degrees <= _MOST_DEG:
        raise ParameterError(
            f"lens={text!r}: a field of view must be from {_LEAST_DEG:g} to {_MOST_DEG:g} degrees"
        )
    return lens_of_angle(degrees, size)


def lens_of_model(model: str, size: Size) -> CameraInfo | None:
    """The lens of a camera of the table, whatever its maker; None if it is unknown."""
    name = model.strip().upper().removeprefix("DJI").strip(" _-")
    if name in _FOCAL_MM:
        return lens_of_focal(_FOCAL_MM[name], size)
    if name in _WIDTH_DEG:
        return lens_of_angle(_WIDTH_DEG[name], size)
    if name in _FISHEYE_DEG:
        half = math.radians(_FISHEYE_DEG[name] / 2)
        return _lens(size[0] / 2 / half, size, is_fisheye=True)
    return None


def lens_of_focal(focal_mm: float, size: Size) -> CameraInfo:
    """The lens of a focal length as of 36 x 24 mm, by the diagonal of the whole sensor.

    Wider images than of 3:2 are parts of those of a sensor of 4:3, which most such cameras have.
    """
    longer, shorter = max(size), min(size)
    if longer > _WIDEST * shorter:
        shorter = round(0.75 * longer)
    return _lens(focal_mm / _DIAGONAL_MM * math.hypot(longer, shorter), size)


def lens_of_angle(degrees: float, size: Size) -> CameraInfo:
    """The lens of a horizontal field of view."""
    return _lens(size[0] / 2 / math.tan(math.radians(degrees) / 2), size)


def _lens(focal_px: float, size: Size, is_fisheye: bool = False) -> CameraInfo:
    width, height = size
    K = np.array([[focal_px, 0, (width - 1) / 2], [0, focal_px, (height - 1) / 2], [0, 0, 1]])
    D, model = (np.zeros(4), "equidistant") if is_fisheye else (np.zeros(0), "")
    return CameraInfo(height, width, K, D, distortion_model=model)

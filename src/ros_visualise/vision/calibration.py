"""The calibration of an image that was resized or flipped.

Pixel coordinates have their origin at the centre of the top-left pixel, so an image's left border
is at -0.5.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ros_visualise.data import CameraInfo
from ros_visualise.vision.reshape import Size

Matrix = npt.NDArray[np.float64]

# of p1 p2, thin prism s1 s2 s3 s4, tilt tau_x tau_y in OpenCV's order of the coefficients
_ODD_IN_X = [3, 8, 9, 13]
_ODD_IN_Y = [2, 10, 11, 12]


def resized(info: CameraInfo, before: Size, after: Size) -> CameraInfo:
    """The calibration of the image resized from ``before`` to ``after``; D and R stay."""
    scale = np.divide(after, before)
    to_new = np.diag([*scale, 1.0])
    to_new[:2, 2] = (scale - 1) / 2
    return replace(
        info,
        width=after[0],
        height=after[1],
        K=to_new @ info.K,
        P=None if info.P is None else to_new @ info.P,
    )


def flipped(info: CameraInfo, size: Size, *, horizontal: bool, vertical: bool) -> CameraInfo:
    """The calibration of the mirrored image: what it sees is the mirrored world.

    A point (x, y, z) of the camera's frame is at (-x, y, z) after a horizontal flip; focal lengths
    stay positive.

    Args:
        info: calibration of the original image.
        size: of the image.
        horizontal, vertical: which ways it is mirrored.
    """
    signs = np.array([-1.0 if horizontal else 1.0, -1.0 if vertical else 1.0])
    mirror = np.diag([*signs, 1.0])
    to_new = mirror.copy()
    to_new[:2, 2] = np.where(signs < 0, np.subtract(size, 1), 0)
    mirror_4 = np.diag([*signs, 1.0, 1.0])
    return replace(
        info,
        K=to_new @ info.K @ mirror,
        D=_mirrored_distortion(info, horizontal, vertical),
        R=mirror @ info.R @ mirror,
        P=None if info.P is None else to_new @ info.P @ mirror_4,
    )


def _mirrored_distortion(info: CameraInfo, horizontal: bool, vertical: bool) -> Matrix:
    if info.distortion_model == "equidistant":
        return info.D  # radial alone
    signs = np.ones(max(14, len(info.D)))
    signs[_ODD_IN_X] *= -1 if horizontal else 1
    signs[_ODD_IN_Y] *= -1 if vertical else 1
    return info.D * signs[: len(info.D)]

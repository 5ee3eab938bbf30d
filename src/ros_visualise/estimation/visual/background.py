"""Things that move before a camera at rest.

A car that fills much of an image moves its corners as a moving camera would, and what is behind it
looks infinitely far away. So a motion is not believed if, while near things passed by, a good part
of the image has stayed where it was, to a fraction of a pixel: a camera that moves turns a little,
even on a gimbal. Patches are compared by their correlation, which a changed exposure leaves alone.

Source: B. Lucas, T. Kanade, An iterative image registration technique, 1981 (the shift of a patch);
J. Lewis, Fast normalized cross-correlation, 1995.
"""

from __future__ import annotations

import cv2
import numpy as np

from ros_visualise.data import Floats, Pixels

MOVING_THINGS = "objects pass in front of a camera at rest"
_WIDTH, _PATCH, _AROUND = 160, 16, 9  # pixels: of a small image, its patches, and their brightness
_TEXTURE = 0.7  # gray levels, standard deviation in a patch
_ALIKE = 0.7  # correlation
_LEAST, _SHARE = 4, 0.12  # patches, and of those with texture
_MOST = 1 / 640  # of the width, their shift; a good gimbal leaves three times as much
_MOST_AT_FIRST = _MOST / 4  # the same between two images that may have followed soon


def background_rests(before: Pixels, gray: Pixels, at_first: bool = False) -> bool:
    """True if a good part of the image (H, W), uint8, is where it was in one some time before.

    Args:
        at_first: that time may have been short.
    """
    small = [_without_brightness(one) for one in (before, gray)]
    first, second = (_patches(one) for one in small)
    spreads = first.std(axis=1), second.std(axis=1)
    has_texture = np.minimum(*spreads) > _TEXTURE
    both = np.maximum(spreads[0] * spreads[1], 1e-9)
    stays = has_texture & ((first * second).mean(axis=1) > _ALIKE * both)
    scale = (spreads[0] + spreads[1])[stays, None] / 2
    mean = (small[0] + small[1]) / 2
    slopes = (np.gradient(mean, axis=axis) for axis in (0, 1))
    J = np.stack([_patches(one)[stays] / scale for one in slopes], axis=2)
    off = first[stays] / spreads[0][stays, None] - second[stays] / spreads[1][stays, None]
    H = np.swapaxes(J, 1, 2) @ J + 1e-3 * np.eye(2)
    shifts = np.linalg.solve(H, np.swapaxes(J, 1, 2) @ off[..., None])[..., 0]
    most = (_MOST_AT_FIRST if at_first else _MOST) * small[0].shape[1]
    resting = int((np.linalg.norm(shifts, axis=1) < most).sum())
    return resting >= max(_LEAST, _SHARE * int(has_texture.sum()))


def _without_brightness(gray: Pixels) -> Floats:
    """A small image less its mean around each pixel."""
    factor = _WIDTH / gray.shape[1]
    thin = cv2.resize(gray, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
    small: Floats = np.asarray(thin, np.float64)
    return np.asarray(small - cv2.blur(small, (_AROUND, _AROUND)), np.float64)


def _patches(image: Floats) -> Floats:
    """(N, pixels) of its patches."""
    rows, columns = image.shape[0] // _PATCH, image.shape[1] // _PATCH
    cut = image[: rows * _PATCH, : columns * _PATCH].reshape(rows, _PATCH, columns, _PATCH)
    found: Floats = cut.swapaxes(1, 2).reshape(rows * columns, _PATCH * _PATCH)
    return found

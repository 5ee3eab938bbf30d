"""Views between which a camera only turned, whatever its focal length is.

With a wrong focal length, or a lens that bends what it should not, a turn on the spot leaves
differences that look like parallax, and a motion fits them. So a motion is believed only if no turn
explains the two views, with any focal length and bend that the lens may have.

Source: S. Umeyama, Least-squares estimation of transformation parameters, 1991 (the rotation); P.
Torr, A. Fitzgibbon, A. Zisserman, The problem of degeneracy in structure and motion recovery, 1999.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from ros_visualise.data import Floats

TURNING = "the camera seems only to turn on the spot"
_USUAL = (0.8, 0.6, 1.0, 0.45, 1.3, 0.35, 1.6)  # focal lengths, in widths of the image
_NEAR = (1.0, 0.95, 1.05, 0.9, 1.1)  # of a calibrated one, as a fraction of it
_BENDS = (0.0, 0.12, 0.3)  # of a lens: how much farther out a corner at one focal length is
_MOST = 0.8  # of the corners
_NOISE = 1.5  # standard deviations of directions
_OF_MOVE = 0.015, 0.04  # of the corners' own motion; with a guess, between two that are tried
_STEPS = 5


def only_turned(first: Floats, second: Floats, sigma: float, guess: float = 0.0) -> bool:
    """True if a turn explains two views, by directions (N, 2) of the same corners.

    Args:
        sigma: standard deviation of directions.
        guess: focal length that the directions were made with, in widths of the image, if it is
            not calibrated.
    """
    move = float(np.median(np.linalg.norm(second - first, axis=1)))
    most = max(_NOISE * sigma, _OF_MOVE[bool(guess)] * move)
    tried = product([one / guess for one in _USUAL] if guess else _NEAR, _BENDS if guess else (0,))
    return any(
        _left(_unit(first, factor, bend), _unit(second, factor, bend), most / factor) * factor
        < most
        for factor, bend in tried
    )


def _unit(rays: Floats, factor: float, bend: float) -> Floats:
    """(N, 3) unit directions, seen by a lens of another focal length, and bent outwards."""
    out = rays * (1 + bend * (rays**2).sum(axis=1, keepdims=True)) / factor
    found = np.insert(out, 2, 1.0, axis=1)
    unit: Floats = found / np.linalg.norm(found, axis=1, keepdims=True)
    return unit


def _left(first: Floats, second: Floats, off: float) -> float:
    """Distance of corners from where the best turn takes them, of the worst but a fifth."""
    away = np.zeros(len(first))
    for _ in range(_STEPS):
        weights = 1 / (1 + (away / max(float(np.median(away)), off)) ** 2)
        U, _, Vt = np.linalg.svd((second * weights[:, None]).T @ first)
        R = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
        away = np.linalg.norm(second - first @ R.T, axis=1)
    return float(np.quantile(away, _MOST))

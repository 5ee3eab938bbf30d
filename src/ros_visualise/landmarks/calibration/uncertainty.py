"""Projection uncertainty of a calibrated camera for distant points.

A change of the camera's numbers that a small rotation of the camera compensates is not an error of
projection, because users of the camera estimate its attitude from the same pixels. So the best
compensating rotation over the whole image is removed first.

Source: D. Kogan, mrcal: the projection uncertainty with the effect of moved cameras removed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.calibration.adjustment import BundleFit
from ros_visualise.landmarks.calibration.lenses import LensModel, project, to_rays
from ros_visualise.vision.reshape import Size

_COLUMNS, _ROWS = 9, 7  # odd, so that the centre is included
_CLOSE_PX = 0.1  # largest error of back and forth projection, exceeded where a polynomial folds
_SURE_PX2 = 1e-6


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Projection uncertainty, one standard deviation, pixels.

    Attributes:
        pixels: (rows, columns) over the image, from border to border; infinite where the model has
            no ray for a pixel.
    """

    pixels: Floats

    @property
    def centre(self) -> float:
        """In the centre of the image."""
        rows, columns = self.pixels.shape
        return float(self.pixels[rows // 2, columns // 2])

    @property
    def corners(self) -> float:
        """In the worst corner of the image."""
        return float(self.pixels[:: self.pixels.shape[0] - 1, :: self.pixels.shape[1] - 1].max())


def uncertainty_of(fit: BundleFit, model: LensModel, size: Size) -> Uncertainty:
    """The uncertainty from the covariance of the camera's numbers."""
    assert fit.covariance is not None
    u, v = np.meshgrid(np.linspace(0, size[0] - 1, _COLUMNS), np.linspace(0, size[1] - 1, _ROWS))
    uv = np.stack([u.ravel(), v.ravel()], axis=1)
    rays = to_rays(uv, fit.numbers, model)
    points = np.column_stack([rays, np.ones(len(rays))])
    back, by_numbers, by_pose = project(points, np.zeros(6), fit.numbers, model)
    is_seen = np.linalg.norm(back - uv, axis=1) < _CLOSE_PX
    by_numbers, by_turn = (one.reshape(len(uv), 2, -1)[is_seen] for one in (by_numbers, by_pose))
    variances = np.full(len(uv), np.inf)
    variances[is_seen] = _without_turn(by_numbers, by_turn[..., :3], fit.covariance)
    # the covariance of few views may be slightly negative
    return Uncertainty(np.sqrt(np.maximum(variances, 0)).reshape(_ROWS, _COLUMNS))


def _without_turn(by_numbers: Floats, by_turn: Floats, covariance: Floats) -> Floats:
    """Variances (P,), pixels^2, at P points after the best compensating rotation of the camera.

    Points are weighted by their certainty, so that an unseen corner does not affect the rotation.

    Args:
        by_numbers: (P, 2, n), pixels by the camera's numbers.
        by_turn: (P, 2, 3), pixels by a rotation.
        covariance: (n, n).
    """
    weights = 1 / np.sqrt(np.maximum(_variances(by_numbers, covariance), _SURE_PX2))[:, None, None]
    wide, tall = (weights * by_turn).reshape(-1, 3), (weights * by_numbers)
    turn = np.linalg.lstsq(wide, tall.reshape(len(wide), -1), rcond=None)[0]
    return _variances(by_numbers - by_turn @ turn, covariance)


def _variances(by_numbers: Floats, covariance: Floats) -> Floats:
    """(P,) sums over both directions, pixels^2."""
    variances: Floats = np.einsum("pij,jk,pik->p", by_numbers, covariance, by_numbers)
    return variances

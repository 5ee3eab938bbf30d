"""How uncertain it is where a calibrated camera shows what is far away.

A change of the camera's numbers that a small turn of the camera undoes is no error of projection,
for whoever uses the camera finds its attitude by the same pixels. So the turn that undoes most over
the whole image is taken away first.

Source: D. Kogan, mrcal: the projection uncertainty with the effect of moved cameras removed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.calibration.adjustment import BundleFit
from ros_visualise.landmarks.calibration.lenses import LensModel, project, to_rays
from ros_visualise.vision.reshape import Size

_COLUMNS, _ROWS = 9, 7  # odd: one of the places is the centre
_CLOSE_PX = 0.1  # to where a ray comes back; of a polynomial that folds it does not
_SURE_PX2 = 1e-6


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Of the projection, one standard deviation, pixels.

    Attributes:
        pixels: (rows, columns) over the image, from border to border; infinite where the model
            has no ray for a pixel.
    """

    pixels: Floats

    @property
    def centre(self) -> float:
        """In the image's middle."""
        rows, columns = self.pixels.shape
        return float(self.pixels[rows // 2, columns // 2])

    @property
    def corners(self) -> float:
        """In the worst of the image's corners."""
        return float(self.pixels[:: self.pixels.shape[0] - 1, :: self.pixels.shape[1] - 1].max())


def uncertainty_of(fit: BundleFit, model: LensModel, size: Size) -> Uncertainty:
    """Of a camera by the covariance of its numbers."""
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
    # a covariance of few views may be a little less than nothing
    return Uncertainty(np.sqrt(np.maximum(variances, 0)).reshape(_ROWS, _COLUMNS))


def _without_turn(by_numbers: Floats, by_turn: Floats, covariance: Floats) -> Floats:
    """Variances (P,), pixels^2, of P places after the turn of the camera that undoes most.

    Places count by how sure they are, so that a corner that nobody saw turns nothing.

    Args:
        by_numbers: (P, 2, n), pixels by the camera's numbers.
        by_turn: (P, 2, 3), pixels by a turn.
        covariance: (n, n).
    """
    weights = 1 / np.sqrt(np.maximum(_variances(by_numbers, covariance), _SURE_PX2))[:, None, None]
    wide, tall = (weights * by_turn).reshape(-1, 3), (weights * by_numbers)
    turn = np.linalg.lstsq(wide, tall.reshape(len(wide), -1), rcond=None)[0]
    return _variances(by_numbers - by_turn @ turn, covariance)


def _variances(by_numbers: Floats, covariance: Floats) -> Floats:
    """(P,): the sum over both directions, pixels^2."""
    variances: Floats = np.einsum("pij,jk,pik->p", by_numbers, covariance, by_numbers)
    return variances

"""Errors of corners that a camera adds to those that its images show.

A fit of a tag knows the noise of its pixels. It does not know what a lens, a print, a calibration,
or the camera's own processing of images add. Of the eight numbers of a tag's corners the pose
explains six; the others show these errors. Their standard deviation, alike for all corners of a
camera, has a prior, and each image moves it: the more tags, the more certain it is.

The pose absorbs most of the smooth errors of a lens and its calibration: on photographs whose poses
are wrong as by 0.3 pixels, 0.07 to 0.13 are left. So a camera whose residuals show an error at all,
at least a tenth of its floor, has at least the floor; the others have what the residuals show.

Source: D. Harville, Maximum Likelihood Approaches to Variance Component Estimation, 1977 (the
likelihood of what is left of a fit); the weights over a grid are Bayes' rule.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

_GRID_PX = np.array([0.0, *np.geomspace(0.005, 4.0, 24)])
_PRIOR_WIDTH = 1.0  # of the logarithm
_SHOWN = 0.1  # fraction of the floor
_CLEAN, _EXACT = 0.05, 0.99  # probabilities of no error, if one is expected and if not
_WILD_PX, _WILD = 3.0, 0.02  # error of a wrong tag, and its probability
_MEMORY = 300.0  # tags
_PLACES, _STILL_PX = 64, 2.0  # remembered places; a tag that stays shows the same error again


class CornerErrors:
    """Standard deviation of the corners of one camera, beyond their noise."""

    def __init__(self, floor_px: float = 0.0) -> None:
        """Begin with the deviation expected of a real camera, often 0.3; 0 for renderings."""
        grid = _GRID_PX[1:]
        if floor_px > 0:
            weights = np.exp(-((np.log(grid / floor_px) / _PRIOR_WIDTH) ** 2) / 2)
            weights = np.array([_CLEAN, *(1 - _CLEAN) * weights / weights.sum()])
        else:
            weights = np.array([_EXACT, *np.full(len(grid), (1 - _EXACT) / len(grid))])
        is_shown = _SHOWN * floor_px <= _GRID_PX
        self._variances = np.where(is_shown, np.maximum(_GRID_PX, floor_px), _GRID_PX) ** 2
        self._prior = np.log(weights + 1e-300)
        self._evidence = np.zeros(len(_GRID_PX))
        self._places = np.zeros((0, 2))

    @property
    def variance_px2(self) -> float:
        """Expected variance of each coordinate of a corner."""
        log_weight = self._prior + self._evidence
        weight = np.exp(log_weight - log_weight.max())
        return float((weight * self._variances).sum() / weight.sum())

    def learn(self, corners_uv: Floats, residual: Floats, jacobian: Floats, noise: Floats) -> None:
        """Learn from the bodies of one image.

        Args:
            corners_uv: (B, N, 2) pixels.
            residual: (B, 2N) of the fitted poses, pixels; infinite ones are ignored.
            jacobian: (B, 2N, 6) of the residuals by the poses.
            noise: (B, 2N, 2N) covariances of the corners, square pixels.
        """
        places = corners_uv.mean(axis=1)
        usable = np.isfinite(residual).all(axis=1) & np.isfinite(jacobian).all(axis=(1, 2))
        usable &= np.isfinite(noise).all(axis=(1, 2)) & self._is_new(places)
        if not usable.any():
            return
        left, spread = _unexplained(residual[usable], jacobian[usable], noise[usable])
        likely = _log_likelihood(left, spread, _GRID_PX)
        wild = _log_likelihood(left, spread, np.array([_WILD_PX]))
        robust = np.logaddexp(np.log(1 - _WILD) + likely, np.log(_WILD) + wild)
        self._evidence = self._evidence * (1 - 1 / _MEMORY) ** len(left) + robust.sum(axis=0)
        self._places = np.concatenate([self._places, places[usable]])[-_PLACES:]

    def _is_new(self, places: Floats) -> npt.NDArray[np.bool_]:
        away = np.linalg.norm(places[:, None] - self._places, axis=-1)
        return np.asarray(away.min(axis=1, initial=np.inf) > _STILL_PX)


def _unexplained(residual: Floats, jacobian: Floats, noise: Floats) -> tuple[Floats, Floats]:
    """Uncorrelated parts (B, 2N - 6) of the residual that no pose explains, and their variances."""
    across = np.linalg.svd(jacobian)[0][:, :, 6:]
    back = np.swapaxes(across, 1, 2)
    spread, axes = np.linalg.eigh(back @ noise @ across)
    left = (np.swapaxes(axes, 1, 2) @ back @ residual[..., None])[..., 0]
    return left, np.maximum(spread, 1e-12)


def _log_likelihood(left: Floats, spread: Floats, extra_px: Floats) -> Floats:
    """(B, G) for extra deviations (G,)."""
    total = spread[:, None] + extra_px[:, None] ** 2
    log: Floats = -((left[:, None] ** 2 / total) + np.log(total)).sum(axis=2) / 2
    return log

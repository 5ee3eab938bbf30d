"""Calibration from views, and its validation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ros_visualise.core.errors import UsageError
from ros_visualise.data import CameraInfo, Floats
from ros_visualise.landmarks.calibration.adjustment import BundleFit, adjust, begin, rms_of
from ros_visualise.landmarks.calibration.finding import FEWEST, BoardPoints
from ros_visualise.landmarks.calibration.lenses import (
    MODELS,
    Lens,
    LensModel,
    project,
    to_info,
    to_rays,
)
from ros_visualise.landmarks.calibration.views import BoardView
from ros_visualise.vision.rectification import model_of
from ros_visualise.vision.reshape import Size

FEWEST_VIEWS = 3
APART = 0.005
"""Largest relative difference in focal length between halves of a trustworthy calibration."""
_OUTLYING = 3.0  # times the median of all views
_OUTLYING_PX = 0.3  # a view with a smaller rms is never an outlier
_MOST_OUTLYING = 0.2  # of the views
_STRAY_PX = 0.3
_STRAY = 7.0  # times the median of all: a mismatched point
_ROUNDS = 3
_COLUMNS, _ROWS = 9, 7  # odd, so that the centre is included
_CLOSE_PX = 0.1  # largest error of back and forth projection, exceeded where a polynomial folds
_SURE_PX2 = 1e-6


@dataclass(frozen=True, eq=False)
class Halves:
    """Two halves of the views, calibrated separately.

    Attributes:
        focal_lengths: of both, the mean of fx and fy, pixels.
        rms: held-out: each half's points predicted with the other half's camera, for which only the
            boards move, pixels.
    """

    focal_lengths: tuple[float, float]
    rms: float

    @property
    def difference(self) -> float:
        """Relative difference of the focal lengths."""
        one, other = self.focal_lengths
        return abs(one - other) / ((one + other) / 2)


@dataclass(frozen=True, eq=False)
class CameraCalibration:
    """A calibrated camera.

    Attributes:
        model: of its lens.
        size: width and height of its images.
        fit: the camera's numbers and their fit.
        views: used for it.
        outliers: rejected views, and their rms, pixels.
        stray: number of rejected points.
        halves: None if the views are too few.
        uncertainty: of the projection.
    """

    model: LensModel
    size: Size
    fit: BundleFit
    views: tuple[BoardView, ...]
    outliers: tuple[tuple[BoardView, float], ...]
    stray: int
    halves: Halves | None
    uncertainty: Uncertainty

    @property
    def info(self) -> CameraInfo:
        """ROS calibration; P shows only valid pixels, as computed by cameracalibrator."""
        info = to_info(self.fit.numbers, self.model, self.size)
        return replace(info, P=model_of(info, 0.0).P)

    @property
    def deviations(self) -> Floats:
        """(n,) standard deviations of the camera's numbers."""
        assert self.fit.covariance is not None
        deviations: Floats = np.sqrt(np.diag(self.fit.covariance))
        return deviations


def calibrate(views: Sequence[BoardView], lens: Lens) -> CameraCalibration:
    """The camera that took the views, all of one size.

    Views and points that fit far worse than the others are rejected.

    Raises:
        UsageError: too few views.
    """
    if len(views) < FEWEST_VIEWS:
        raise UsageError(
            f"too few distinct views of the board: {len(views)}; take at least {FEWEST_VIEWS},"
            " preferably 15, with the board tilted, close to the camera, and in all corners of"
            " the image"
        )
    model = MODELS[lens]
    kept, outliers = list(views), []
    fit = adjust(kept, model, begin(kept, model))
    for number in _outlying(fit):
        outliers.append((kept[number], fit.view_rms[number]))
    if outliers:
        gone = [view for view, _ in outliers]
        kept = [view for view in kept if view not in gone]
        fit = adjust(kept, model, fit.numbers, fit.bend)
    whole, stray = kept, 0
    for _ in range(_ROUNDS):
        before = stray
        kept, stray = _without_stray(whole, fit, model)
        if stray == before:
            break
        fit = adjust(kept, model, fit.numbers, fit.bend)
    size = views[0].size
    return CameraCalibration(
        model=model,
        size=size,
        fit=fit,
        views=tuple(kept),
        outliers=tuple(outliers),
        stray=stray,
        halves=compare_halves(kept, model),
        uncertainty=uncertainty_of(fit, model, size),
    )


def compare_halves(views: Sequence[BoardView], model: LensModel) -> Halves | None:
    """Calibrate every other view, and the rest, separately; None if there are too few."""
    halves = views[::2], views[1::2]
    if len(halves[1]) < FEWEST_VIEWS:
        return None
    fits = [adjust(half, model, begin(half, model)) for half in halves]
    held = [
        adjust(half, model, fit.numbers, fit.bend, held=True)
        for half, fit in zip(halves, reversed(fits), strict=True)
    ]
    one, other = (float(fit.numbers[:2].mean()) for fit in fits)
    return Halves((one, other), rms_of(np.vstack([r for fit in held for r in fit.residuals])))


def better_lens(calibration: CameraCalibration) -> Lens | None:
    """The simplest other lens that predicts held-out views clearly better, or equally well.

    None if the chosen one is right.
    """
    if calibration.halves is None:
        return None
    chosen = calibration.model.lens
    rms = {chosen: calibration.halves.rms}
    for lens, model in MODELS.items():
        if lens is not chosen:
            halves = compare_halves(calibration.views, model)
            rms[lens] = np.inf if halves is None else halves.rms
    best = min(rms.values())
    wanted = next(lens for lens in Lens if rms[lens] <= best * 1.03)
    is_simpler = [*Lens].index(wanted) < [*Lens].index(chosen) and chosen is Lens.RATIONAL
    is_better = rms[wanted] < rms[chosen] * 0.95
    return wanted if wanted is not chosen and (is_simpler or is_better) else None


def _outlying(fit: BundleFit) -> list[int]:
    """Views that fit far worse than most, the worst first; limited to a fraction of all."""
    # medians, so that one stray point does not reject its whole view
    error = np.array([np.median(np.linalg.norm(one, axis=1)) for one in fit.residuals])
    limit = max(_OUTLYING * float(np.median(error)), _OUTLYING_PX)
    worst = np.argsort(-error)[: int(len(error) * _MOST_OUTLYING)]
    return [int(number) for number in worst if error[number] > limit]


def _without_stray(
    views: list[BoardView], fit: BundleFit, model: LensModel
) -> tuple[list[BoardView], int]:
    """The views without points that lie far from their prediction, and the number of these.

    Args:
        views: with all of their points, so that a point rejected only because of a stray one
            returns.
        fit: of these boards, possibly with fewer points.
        model: of the lens.
    """
    lengths = np.linalg.norm(np.vstack(fit.residuals), axis=1)
    limit = max(_STRAY * float(np.median(lengths)), _STRAY_PX)
    kept, stray = [], 0
    for view, pose in zip(views, fit.poses, strict=True):
        uv, _, _ = project(view.bent_xyz(fit.bend), pose, fit.numbers, model)
        is_near = np.linalg.norm(uv - view.points.uv, axis=1) < limit
        if is_near.sum() >= FEWEST and not is_near.all():
            stray += int((~is_near).sum())
            points = BoardPoints(view.points.numbers[is_near], view.points.uv[is_near])
            kept.append(replace(view, points=points))
        else:
            kept.append(view)
    return kept, stray


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Projection uncertainty for distant points, one standard deviation, pixels.

    A change of the camera's numbers that a small rotation of the camera compensates is no error of
    projection: users estimate the attitude from the same pixels. So the best rotation is removed.

    Source: D. Kogan, mrcal: the projection uncertainty with the effect of moved cameras removed.

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

"""Bundle adjustment of a camera and its boards.

Least squares of the reprojection by Levenberg and Marquardt. Each board's pose affects only its own
view, so poses are eliminated first (the Schur complement). What is left is the information matrix
of the camera's numbers, whose inverse is their covariance.

Source: Triggs et al., Bundle Adjustment - A Modern Synthesis, 2000, sections 5 and 6.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.calibration.lenses import LensModel, project, to_rays
from ros_visualise.landmarks.calibration.views import BoardView

_MOST_STEPS = 60
_DONE = 1e-9  # relative decrease of the sum of squares at which it stops
_FAR_RAY = 6.0  # largest useful slope of a ray
_FOCAL_LENGTHS = np.geomspace(0.2, 5, 30)  # initial guesses, in lengths of the longer side
_BEGUN_WITH = 12  # views used for the initial guess
_HOPELESS = 1e12


@dataclass(frozen=True, eq=False)
class BundleFit:
    """Best-fit camera and boards.

    Attributes:
        numbers: (n,) of the camera.
        poses: (V, 6) of the boards in the camera's frame.
        residuals: of each view (N, 2), pixels: predicted minus measured.
        covariance: (n, n) of the numbers, scaled by the residuals; None if the camera was held.
    """

    numbers: Floats
    poses: Floats
    residuals: list[Floats]
    covariance: Floats | None

    @property
    def rms(self) -> float:
        """Root mean square of the reprojection errors, pixels."""
        return rms_of(np.vstack(self.residuals))

    @property
    def view_rms(self) -> list[float]:
        """The same for each view."""
        return [rms_of(one) for one in self.residuals]


def rms_of(residuals: Floats) -> float:
    """Root mean square length of residuals (N, 2)."""
    return float(np.sqrt((residuals**2).sum(axis=1).mean()))


def begin(views: Sequence[BoardView], model: LensModel) -> Floats:
    """Initial numbers of the camera: no distortion, and the best focal length."""
    width, height = views[0].size
    middle = [(width - 1) / 2, (height - 1) / 2]
    some = views[:: max(1, len(views) // _BEGUN_WITH)]

    def misfit(focal: float) -> float:
        numbers = np.array([focal, focal, *middle, *[0.0] * len(model.coefficients)])
        return float(np.median([_misfit(view, numbers, model) for view in some]))

    focal_lengths = _FOCAL_LENGTHS * max(width, height)
    best = min(focal_lengths, key=misfit)
    return np.array([best, best, *middle, *[0.0] * len(model.coefficients)])


def adjust(
    views: Sequence[BoardView], model: LensModel, numbers: Floats, *, held: bool = False
) -> BundleFit:
    """Fit the camera and the boards' poses to the views.

    Args:
        views: of at least 3 boards, unless the camera is held.
        model: of the lens.
        numbers: initial values of the camera's numbers.
        held: keep the camera fixed; only the boards move.
    """
    poses = np.array([_pose(view, numbers, model) for view in views])
    system = _System(views, model, numbers, poses, held)
    damping = 1e-3
    for _ in range(_MOST_STEPS):
        step = system.step(damping)
        tried = _System(views, model, numbers + step[0], poses + step[1], held)
        if tried.cost < system.cost:
            is_done = system.cost - tried.cost < _DONE * system.cost
            numbers, poses, system = numbers + step[0], poses + step[1], tried
            damping = max(damping / 10, 1e-12)
            if is_done:
                break
        elif damping > _HOPELESS:
            break
        else:
            damping *= 10
    covariance = None if held else system.covariance()
    return BundleFit(numbers, poses, system.residuals, covariance)


class _System:
    """The linear equations around one state."""

    def __init__(
        self,
        views: Sequence[BoardView],
        model: LensModel,
        numbers: Floats,
        poses: Floats,
        held: bool,
    ) -> None:
        self._held = held
        self._U = np.zeros((len(numbers), len(numbers)))
        self._ga = np.zeros(len(numbers))
        self._blocks: list[tuple[Floats, Floats, Floats]] = []
        self.residuals: list[Floats] = []
        for view, pose in zip(views, poses, strict=True):
            uv, A, B = project(view.points_xyz, pose, numbers, model)
            residual = uv - view.points.uv
            flat = residual.ravel()
            self.residuals.append(residual)
            self._U += A.T @ A
            self._ga += A.T @ flat
            self._blocks.append((B.T @ B, A.T @ B, B.T @ flat))
        cost = sum(float((one**2).sum()) for one in self.residuals)
        self.cost = cost if np.isfinite(cost) else np.inf

    def step(self, damping: float) -> tuple[Floats, Floats]:
        """The change of the camera's numbers and the poses (V, 6)."""
        V_inverse = [np.linalg.inv(_damped(V, damping)) for V, _, _ in self._blocks]
        numbers = np.zeros(len(self._U))
        if not self._held:
            S, g = _damped(self._U, damping), self._ga.copy()
            for inverse, (_, W, gb) in zip(V_inverse, self._blocks, strict=True):
                S -= W @ inverse @ W.T
                g -= W @ inverse @ gb
            numbers = -np.linalg.lstsq(S, g, rcond=None)[0]
        poses = [
            -inverse @ (gb + W.T @ numbers)
            for inverse, (_, W, gb) in zip(V_inverse, self._blocks, strict=True)
        ]
        return numbers, np.array(poses)

    def covariance(self) -> Floats:
        """Covariance of the camera's numbers, given pixel noise as large as the residuals."""
        S = self._U.copy()
        for V, W, _ in self._blocks:
            S -= W @ np.linalg.pinv(V) @ W.T
        count = sum(one.size for one in self.residuals)
        free = max(count - len(S) - 6 * len(self._blocks), 1)
        scale = 1 / np.sqrt(
            np.maximum(np.diag(S), 1e-300)
        )  # for numbers of very different magnitude
        return (
            np.linalg.pinv(S * np.outer(scale, scale)) * np.outer(scale, scale) * self.cost / free
        )


def _damped(matrix: Floats, damping: float) -> Floats:
    return matrix + np.diag(np.diag(matrix) * damping + 1e-12)


def _pose(view: BoardView, numbers: Floats, model: LensModel) -> Floats:
    """A board's pose (6,) from the rays of its points, except extreme ones."""
    rays = to_rays(view.points.uv, numbers, model)
    points = view.points_xyz
    near = np.abs(rays).max(axis=1) < _FAR_RAY
    if near.sum() < 4:
        near[:] = True
    flat = points[near] - points.mean(axis=0) * [1, 1, 0]
    ok, turn, move = cv2.solvePnP(
        flat[:, None], rays[near][:, None], np.eye(3), None, flags=cv2.SOLVEPNP_IPPE
    )
    if not ok:
        return np.array([0.0, 0, 0, 0, 0, 1])
    offset = cv2.Rodrigues(turn)[0] @ (points.mean(axis=0) * [1, 1, 0])
    return np.concatenate([turn.ravel(), move.ravel() - offset])


def _misfit(view: BoardView, numbers: Floats, model: LensModel) -> float:
    pose = _pose(view, numbers, model)
    uv, _, _ = project(view.points_xyz, pose, numbers, model)
    error = rms_of(uv - view.points.uv)
    return error if np.isfinite(error) else np.inf

"""Bundle adjustment of a camera and its boards.

Least squares of the reprojection by Levenberg and Marquardt. Each board's pose affects only its own
view, so poses are eliminated first (the Schur complement). What is left is the information matrix
of what all views share: the camera's numbers, and the bend of the board, which is never flat.

Source: Triggs et al., Bundle Adjustment - A Modern Synthesis, 2000, sections 5 and 6.1; D. Kogan,
mrcal: the bend of the board.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.calibration.boards import Ints
from ros_visualise.landmarks.calibration.lenses import LensModel, project, to_rays
from ros_visualise.landmarks.calibration.views import BoardView

_MOST_STEPS = 60
_DONE = 1e-9  # relative decrease of the sum of squares at which it stops
_FAR_RAY = 6.0  # largest useful slope of a ray
_FOCAL_LENGTHS = np.geomspace(0.2, 5, 30)  # initial guesses, in lengths of the longer side
_BEGUN_WITH = 12  # views used for the initial guess
_HOPELESS = 1e12
_FLAT_PX = 20.0  # weight of the bend: 0.2 px for 1 % of half the board's diagonal
_BENDS = 3
_RAYS = np.eye(3)  # the camera of points given as rays
_BLOCK = 3  # consecutive views that may share errors
_BLOCKS = 4  # least number of blocks of views
_LEAST = 1e-12  # of sums of squares, where all fits exactly


@dataclass(frozen=True, eq=False)
class BundleFit:
    """Best-fit camera and boards.

    Attributes:
        numbers: (n,) of the camera.
        poses: (V, 6) of the boards in the camera's frame.
        bend: (3,) of the board, see `BoardView.bends`.
        residuals: of each view (N, 2), pixels: predicted minus measured.
        covariance: (n, n) of the numbers; None if the camera was held.
    """

    numbers: Floats
    poses: Floats
    bend: Floats
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
    some = views[:: -(-len(views) // _BEGUN_WITH)]

    def misfit(focal: float) -> float:
        numbers = np.array([focal, focal, *middle, *[0.0] * len(model.coefficients)])
        return float(np.median([_misfit(view, numbers, model) for view in some]))

    focal_lengths = (_FOCAL_LENGTHS * max(width, height)).tolist()
    near = min(range(1, len(focal_lengths), 3), key=lambda number: misfit(focal_lengths[number]))
    best = min(focal_lengths[max(near - 2, 0) : near + 3], key=misfit)
    return np.array([best, best, *middle, *[0.0] * len(model.coefficients)])


def adjust(
    views: Sequence[BoardView],
    model: LensModel,
    numbers: Floats,
    bend: Floats | None = None,
    *,
    held: bool = False,
) -> BundleFit:
    """Fit the camera and the boards' poses to the views.

    Args:
        views: of at least 3 boards, unless the camera is held.
        model: of the lens.
        numbers: initial values of the camera's numbers.
        bend: of the board; None: flat.
        held: keep camera and bend fixed; only the boards move.
    """
    poses = np.array([_pose(view, numbers, model) for view in views])
    shared = np.concatenate([numbers, np.zeros(_BENDS) if bend is None else bend])
    system = _System(views, model, shared, poses, held)
    damping = 1e-3
    for _ in range(_MOST_STEPS):
        step = system.step(damping)
        tried = _System(views, model, shared + step[0], poses + step[1], held)
        if tried.cost < system.cost:
            is_done = system.cost - tried.cost < _DONE * system.cost
            shared, poses, system = shared + step[0], poses + step[1], tried
            damping = max(damping / 10, 1e-12)
            if is_done:
                break
        elif damping > _HOPELESS:
            break
        else:
            damping *= 10
    count = len(numbers)
    points = np.concatenate([view.points.numbers for view in views])
    covariance = None if held else system.covariance(points)[:count, :count]
    return BundleFit(shared[:count], poses, shared[count:], system.residuals, covariance)


class _System:
    """The linear equations around one state; ``shared`` are the camera's numbers and the bend."""

    def __init__(
        self,
        views: Sequence[BoardView],
        model: LensModel,
        shared: Floats,
        poses: Floats,
        held: bool,
    ) -> None:
        self._held = held
        numbers, bend = shared[:-_BENDS], shared[-_BENDS:]
        prior = np.concatenate([np.zeros(len(numbers)), np.full(_BENDS, _FLAT_PX**2)])
        self._prior = np.diag(prior)
        self._rows: list[tuple[Floats, Floats, Floats]] = []
        self.residuals: list[Floats] = []
        for view, pose in zip(views, poses, strict=True):
            uv, by_numbers, B = project(view.bent_xyz(bend), pose, numbers, model)
            by_height = B[:, 3:] @ cv2.Rodrigues(pose[:3].copy())[0][:, 2]
            A = np.hstack([by_numbers, by_height[:, None] * np.repeat(view.bends, 2, axis=0)])
            self.residuals.append(uv - view.points.uv)
            self._rows.append((A, B, self.residuals[-1].ravel()))
        self._U = self._prior + sum(A.T @ A for A, _, _ in self._rows)
        self._ga = prior * shared + sum(A.T @ residual for A, _, residual in self._rows)
        cost = sum(float((one**2).sum()) for one in self.residuals) + float(prior @ shared**2)
        self.cost = cost if np.isfinite(cost) else np.inf

    def step(self, damping: float) -> tuple[Floats, Floats]:
        """The change of what the views share, and of the poses (V, 6)."""
        blocks = [
            (np.linalg.inv(_damped(B.T @ B, damping)), A.T @ B, B.T @ residual)
            for A, B, residual in self._rows
        ]
        shared = np.zeros(len(self._U))
        if not self._held:
            S = _damped(self._U, damping) - sum(W @ V_inverse @ W.T for V_inverse, W, _ in blocks)
            g = self._ga - sum(W @ V_inverse @ gb for V_inverse, W, gb in blocks)
            shared = -np.linalg.lstsq(S, g, rcond=None)[0]
        poses = [-V_inverse @ (gb + W.T @ shared) for V_inverse, W, gb in blocks]
        return shared, np.array(poses)

    def covariance(self, numbers: Ints) -> Floats:
        """Covariance of what the views share; ``numbers`` (N,) of all points on the board."""
        return covariance_of(self._rows, self._prior, numbers, self.cost)


def _damped(matrix: Floats, damping: float) -> Floats:
    return matrix + np.diag(np.diag(matrix) * damping + 1e-12)


def _pose(view: BoardView, numbers: Floats, model: LensModel) -> Floats:
    """A board's pose (6,) from the rays of its points, except extreme ones."""
    rays = to_rays(view.points.uv, numbers, model)
    points = view.points_xyz
    near = np.abs(rays).max(axis=1) < _FAR_RAY
    if near.sum() < 4:
        near[:] = True
    middle = points.mean(axis=0)  # its height is 0
    flat = points[near] - middle
    ok, turn, move = cv2.solvePnP(
        flat[:, None], rays[near][:, None], _RAYS, None, flags=cv2.SOLVEPNP_IPPE
    )
    if not ok:
        return np.array([0.0, 0, 0, 0, 0, 1])
    offset = cv2.Rodrigues(turn)[0] @ middle
    return np.concatenate([turn.ravel(), move.ravel() - offset])


def _misfit(view: BoardView, numbers: Floats, model: LensModel) -> float:
    pose = _pose(view, numbers, model)
    uv, _, _ = project(view.points_xyz, pose, numbers, model)
    error = rms_of(uv - view.points.uv)
    return error if np.isfinite(error) else np.inf


def covariance_of(
    rows: Sequence[tuple[Floats, Floats, Floats]], prior: Floats, numbers: Ints, cost: float
) -> Floats:
    """(n, n) covariance of what the views share, by how much they contradict one another.

    Errors of one view are not independent: they share its light, blur and motion. So it is that of
    the results without one view each (the jackknife), and larger where views that follow one
    another share errors too. Sightings of one point of the board share the error of its print,
    which is added likewise. With few views the jackknife is itself uncertain, and blind in some
    directions. So it is averaged with the covariance of independent errors, enlarged to the same
    size.

    Args:
        rows: of each view, the derivatives (2N, n) by what is shared and (2N, 6) by the board's
            pose, and the residuals (2N,), pixels.
        prior: (n, n) information beyond the views.
        numbers: (N of all views,) of the points on the board.
        cost: sum of the squared residuals.

    Source: B. Efron, The Jackknife, the Bootstrap and Other Resampling Plans, 1982, chapter 3; A.
    Cameron, D. Miller, A Practitioner's Guide to Cluster-Robust Inference, Journal of Human
    Resources 50, 2015, sections VI.B (the same for clusters) and V.A (views and points).
    """
    information, scores = [], []
    for A, B, residual in rows:
        J = A - B @ (np.linalg.pinv(B) @ A)  # without the view's pose
        information.append(J.T @ J)
        scores.append((J * residual[:, None]).reshape(-1, 2, len(A.T)).sum(axis=1))
    S = prior + sum(information)
    free = max(sum(len(r) for *_, r in rows) - len(S) - 6 * len(rows), 1)
    independent = _inverse(S) * max(cost, _LEAST) / free
    views = [(one, score.sum(axis=0)) for one, score in zip(information, scores, strict=True)]
    by_views = _jackknife(S, views, 1)
    by_blocks = _jackknife(S, views, int(np.clip(len(views) // _BLOCKS, 1, _BLOCK)))
    larger = max(np.trace(S @ by_views) / np.trace(S @ independent), 1.0)
    shared = max(np.trace(S @ by_blocks) / max(np.trace(S @ by_views), _LEAST), 1.0)
    covariance: Floats = shared * (by_views + larger * independent) / 2
    return covariance + _by_points(S, np.vstack(scores), numbers)


def _by_points(S: Floats, scores: Floats, numbers: Ints) -> Floats:
    """Covariance that sightings of one point of the board share; ``scores`` (N, n) of each."""
    of_points = np.array([scores[numbers == one].sum(axis=0) for one in np.unique(numbers)])
    larger = len(of_points) / max(len(of_points) - 1, 1)
    inverse = _inverse(S)
    beyond = inverse @ (larger * of_points.T @ of_points - scores.T @ scores) @ inverse
    scale = np.sqrt(np.maximum(np.diag(inverse), 1e-300))
    values, axes = np.linalg.eigh(beyond / np.outer(scale, scale))
    positive: Floats = (axes * np.maximum(values, 0)) @ axes.T * np.outer(scale, scale)
    return positive


def _jackknife(S: Floats, views: Sequence[tuple[Floats, Floats]], size: int) -> Floats:
    """Covariance by how the result changes without each block of ``size`` views."""
    moves = []
    for start in range(0, len(views), size):
        block = views[start : start + size]
        moves.append(_inverse(S - sum(U for U, _ in block)) @ sum(g for _, g in block))
    apart = np.array(moves)
    covariance: Floats = (len(moves) - 1) / len(moves) * apart.T @ apart
    return covariance


def _inverse(matrix: Floats) -> Floats:
    """Pseudo-inverse of information about numbers of very different magnitude."""
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    inverse: Floats = np.linalg.pinv(matrix * np.outer(scale, scale)) * np.outer(scale, scale)
    return inverse

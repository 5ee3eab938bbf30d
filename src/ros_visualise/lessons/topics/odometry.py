"""Visual odometry: corners, optical flow, epipolar lines, scale and drift."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from functools import reduce
from typing import NamedTuple

import cv2
import numpy as np

from ros_visualise.core.params import param
from ros_visualise.data import CameraInfo, Floats, Image, Message, Pixels
from ros_visualise.estimation.visual.odometry import VisualOdometry, VisualSettings
from ros_visualise.estimation.visual.starting import FirstMotion, first_motions
from ros_visualise.estimation.visual.stretch import VisualPose
from ros_visualise.geometry import se3
from ros_visualise.lessons.lesson import GIVES, TAKES, Lesson, Step, show, work_of
from ros_visualise.lessons.methods.camera import camera_matrix, project
from ros_visualise.lessons.methods.motion import (
    NO_PAIR,
    ViewPair,
    distances,
    eigenvalues,
    epipolar_lines,
    essential,
    flow_step,
    misfit,
    rays_at,
)
from ros_visualise.lessons.methods.odometry_figures import (
    draw_dots,
    draw_flow,
    draw_lines,
    draw_way,
    draw_world,
)
from ros_visualise.nodes import node
from ros_visualise.vision.rectification import Interpolation, model_of, rectify
from ros_visualise.vision.tracking import PATCH, CornerTracker, FollowedCorners

_VIEWS = 60  # pictures before, one of which is the first view
_COMMON = 0.5  # of the corners, that the first view has too
_LEAST = 30  # corners of both views
_SIGMA_PX = 1.0  # of corners, with a lens that is not known better
_AS_GOOD = 1.15  # misfits of two motions that cannot be told apart
_SHARES = (0.1, 0.9)  # of the points: near and far ones


@dataclass(frozen=True)
class FilmParams:
    """The camera, and its corners."""

    count: int = param(150, "number of corners to follow", min=50, max=1000, slider=(50, 400))
    threshold: float = param(1.0, "smallest accepted eigenvalue, percent of the best corner's",
                             min=0.01, max=100, slider=(0.1, 20))  # fmt: skip
    focal: float = param(0.8, "focal length as a fraction of the image's width, if there is no "
                         "calibration", min=0.2, max=5, slider=(0.3, 2))  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Seen:
    """A picture without distortion, its corners, and the previous picture."""

    bgr: Pixels
    gray: Pixels
    before: Pixels | None
    K: Floats
    followed: FollowedCorners
    corners: FollowedCorners

    @property
    def shape(self) -> tuple[int, int]:
        height, width = self.gray.shape
        return height, width


@node("corners", params=FilmParams, inputs=TAKES, outputs=GIVES)
class GridCorners:
    """Corners: points that can be found again."""

    def __init__(self, params: FilmParams) -> None:
        self._tracker = CornerTracker(params.count)
        self.reset()

    def reset(self) -> None:
        self._tracker.reset()
        self._before: Pixels | None = None

    def step(self, image: Image, params: FilmParams) -> dict[str, Message]:
        """The corners of this picture, and which pixels are like corners."""
        seen = self._see(image, params)
        lesser, greater = eigenvalues(seen.gray)
        y, x = np.unravel_index(lesser.argmax(), lesser.shape)
        least = params.threshold / 100 * lesser[y, x]
        is_corner, is_flat = lesser > least, greater <= least
        text = f"""
            A flat patch of a picture looks the same wherever it is moved to, and a patch of an edge
            looks the same along the edge. Only a corner differs from all its neighbours, so only
            corners can be found again. The derivatives of the gray levels, multiplied and added up
            over 3 × 3 pixels, show this:

                M = Σ [ Ix²   Ix Iy ]
                      [ Ix Iy  Iy²  ]

            Its eigenvalues measure how much the patch changes when it is moved in the directions of
            least and greatest change. If both are small, the patch is flat; if only one is large,
            it is an edge; if both are large, it is a corner. The best corner here, at ({x}, {y}),
            has the eigenvalues {lesser[y, x]:.0f} and {greater[y, x]:.0f}. If we call a value above
            {least:.2f} large, {100 * is_flat.mean():.1f} % of the pixels are flat,
            {100 * (~is_flat & ~is_corner).mean():.1f} % are edges and {100 * is_corner.mean():.1f}
            % are corners. The picture is divided into a grid, and the best corner of each cell is
            followed, so the corners cover the picture: {len(seen.corners.ids)} corners (green).
            """
        return show(image, draw_dots(seen.bgr, seen.corners.pixels_uv), text, seen)

    def _see(self, image: Image, params: FilmParams) -> _Seen:
        bgr, info = work_of(image, np.ndarray), image.camera_info
        height, width = bgr.shape[:2]
        K = camera_matrix(params.focal * width, width, height)
        if info is not None and info.K[0, 0] > 0:
            model = model_of(info, -1)
            bgr, K = rectify(bgr, model, Interpolation.LINEAR), model.P[:, :3]
        gray = cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY)
        before, self._before = self._before, gray
        if before is not None and before.shape != gray.shape:
            before = None
        self._tracker.count = params.count
        followed = self._tracker.follow(gray)
        return _Seen(bgr, gray, before, K, followed, self._tracker.refill())


@node("flow", inputs=TAKES, outputs=GIVES)
def flow(image: Image, params: object) -> dict[str, Message]:
    """Optical flow: where the corners of the previous picture are now."""
    seen = work_of(image, _Seen)
    found = seen.followed
    if seen.before is None or not len(found.ids):
        why = _ONE if seen.before is None else "No corner of the previous picture was found here."
        return show(image, draw_dots(seen.bgr, found.pixels_uv), why)
    moved = found.pixels_uv - found.before_uv
    far = np.hypot(*moved.T)
    most = int(far.argmax())
    step = flow_step(seen.before, seen.gray, found.before_uv[most], PATCH)
    times = max(1, min(10, round(12 / max(float(np.median(far)), 0.1))))
    text = f"""
        When a patch moves by a small displacement d, its gray levels change by the slope times d.
        Each pixel of the patch gives one equation; the corner's matrix M, summed over all pixels
        of the patch, gives the best d:

            I_now − I_before = −(Ix, Iy) · d
            M d = −Σ (Ix, Iy) (I_now − I_before)

        This holds for motions of about a pixel. So the equations are first solved in small copies
        of the picture, and the solution is refined in several passes. The fastest corner, at
        ({found.before_uv[most, 0]:.0f}, {found.before_uv[most, 1]:.0f}), moved by
        ({moved[most, 0]:.1f}, {moved[most, 1]:.1f}) pixels; solving the equations only once gives
        ({step[0]:.1f}, {step[1]:.1f}). Each corner is also followed back, and dropped if it does
        not return to where it began. {len(found.ids)} corners of the previous picture were found in
        this one (arrows{f", drawn {times} times as long" if times > 1 else ""}). Their median
        motion is {np.median(far):.1f} pixels, and the largest is {far[most]:.1f}.
        """
    return show(image, draw_flow(seen.bgr, found.before_uv, times * moved), text)


class _FirstView(NamedTuple):
    """A picture with its corners and their directions (N, 2)."""

    bgr: Pixels
    corners: FollowedCorners
    rays: Floats


@node("epipolar", inputs=TAKES, outputs=GIVES)
class Epipolar:
    """Epipolar lines: how the camera moved."""

    def __init__(self, _: object) -> None:
        self.reset()

    def reset(self) -> None:
        self._views: deque[_FirstView] = deque(maxlen=_VIEWS)
        self._is_shown = False

    def step(self, image: Image, params: object) -> dict[str, Message] | None:
        """The motion since the oldest picture with enough corners in common."""
        seen = work_of(image, _Seen)
        now = _FirstView(seen.bgr, seen.corners, rays_at(seen.K, seen.corners.pixels_uv))
        if self._views and self._views[-1].bgr.shape != now.bgr.shape:
            self._views.clear()
        start, first = next(
            ((n, one) for n, one in enumerate(self._views) if _is_common(one, now)), (0, None)
        )
        self._views.append(now)
        if first is None:
            self._is_shown = False
            return show(image, seen.bgr, _ONE if len(self._views) < 2 else _LOST, NO_PAIR)
        _, a, b = np.intersect1d(first.corners.ids, now.corners.ids, return_indices=True)
        motions = first_motions(first.rays[a], now.rays[b], _SIGMA_PX / seen.K[0, 0])
        if isinstance(motions, str):  # the last motion stays
            return None if self._is_shown else show(image, seen.bgr, _reason(motions), NO_PAIR)
        self._is_shown = True
        uv = first.corners.pixels_uv[a], now.corners.pixels_uv[b]
        motion = _likeliest(motions, first, self._views[(start + len(self._views)) // 2], now)
        return self._shown(image, first.bgr, seen.bgr, ViewPair(seen.K, *uv, motion))

    def _shown(
        self, image: Image, first: Pixels, second: Pixels, pair: ViewPair
    ) -> dict[str, Message]:
        R, t, agree = pair.motion
        E = essential(R, t)
        lines = epipolar_lines(E, pair.K, pair.first_uv)
        away = distances(lines, pair.second_uv)
        way = -R.T @ t
        text = """
            A corner of the first view lies somewhere on a ray. From another place this ray is seen
            as a line, and wherever the corner is on its ray, it must be on that line. The essential
            matrix E gives all these lines; x_first and x_second are the directions (x, y, 1) of a
            corner in the two views:

                x_second' E x_first = 0,  E = [t]× R

            {matrix}

            Eight corners are drawn with their lines; the lines meet where the second camera sees
            the first one. {good} of {count} corners agree with one motion, at a median distance of
            {median:.2f} pixels from their lines; the others are wrong, or belong to objects that
            move. If all corners lie in one plane, two motions fit; a third view decides. At
            {time:.2f} s the motion since the first view is a rotation R by {angle:.1f}° and a step
            in the direction ({x:+.2f}, {y:+.2f}, {z:+.2f}), where x points to the right, y down and
            z ahead. The length of the step is always 1; the next lesson step explains why. The
            focal length is {focal:.0f} pixels.
            """
        return show(
            image,
            draw_lines(first, second, pair, lines),
            text,
            pair,
            matrix="\n".join("    " + "".join(f"{one:9.3f}" for one in row) for row in E),
            good=int(agree.sum()),
            count=len(agree),
            median=np.median(away[agree]),
            angle=np.degrees(np.linalg.norm(se3.rotation_vector(R))),
            x=way[0],
            y=way[1],
            z=way[2],
            focal=pair.K[0, 0],
            time=image.header.stamp_ns / 1e9,
        )


def _likeliest(
    motions: list[FirstMotion], first: _FirstView, between: _FirstView, now: _FirstView
) -> FirstMotion:
    """The motion that fits a third view best; of equally good ones that with the least turn."""
    views = first, between, now
    common = reduce(np.intersect1d, [one.corners.ids for one in views])
    rays = [one.rays[np.isin(one.corners.ids, common)] for one in views]
    scores = [misfit(one, *rays) for one in motions]
    good = [n for n, score in enumerate(scores) if score <= _AS_GOOD * min(scores)]
    turns = [float(np.linalg.norm(se3.rotation_vector(one.R))) for one in motions]
    return motions[min(good, key=turns.__getitem__)]


@dataclass(frozen=True)
class ScaleParams:
    """Another size of the world."""

    factor: float = param(
        2.0, "size of the world relative to the true one", min=0.1, max=10, slider=(0.2, 5)
    )


@node("scale", params=ScaleParams, inputs=TAKES, outputs=GIVES)
def scale(image: Image, params: ScaleParams) -> dict[str, Message]:
    """Scale: a small world nearby looks like a large one far away."""
    pair = work_of(image, ViewPair)
    if pair is NO_PAIR:
        return show(image, image.pixels, _NOTHING)
    z, unsure = pair.depths()
    used = np.isfinite(z)
    if used.sum() < _LEAST:
        return show(image, image.pixels, "Too few corners have a depth: the camera hardly moved.")
    near, far = np.quantile(z[used], _SHARES)
    points = (
        np.column_stack([rays_at(pair.K, pair.first_uv), np.ones(len(z))])[used] * z[used, None]
    )
    R, t, _ = pair.motion
    errors = [
        np.hypot(*(project(k * points @ R.T + k * t, pair.K) - pair.second_uv[used]).T).mean()
        for k in (1.0, params.factor)
    ]
    is_near = z[used] <= np.median(z[used])
    text = f"""
        A corner's point is where the rays of both views meet, so the motion gives each corner a
        depth, but only in units of the camera's own step. Eight out of ten points are {near:.1f} to
        {far:.1f} steps away. If the step and all distances are {params.factor:g} times as long
        (orange), both pictures stay the same: on average, the points appear {errors[0]:.3f} pixels
        from their corners at the original distances, and {errors[1]:.3f} at the multiplied ones.

        So a single camera cannot measure metres. The scale has to come from the height above the
        ground, wheels, GPS, an IMU, or a second camera at a known distance. A depth also needs
        parallax: an error of one pixel changes the depth by a median of
        {100 * np.median(unsure[used][is_near]):.1f} % for the nearer half of these points, and by
        {100 * np.median(unsure[used][~is_near]):.1f} % for the other half.
        """
    return show(image, draw_world(pair, points[points[:, 2] <= far], params.factor), text)


@node("drift", inputs=TAKES, outputs=GIVES)
class WayDrift:
    """Drift: the error grows along the trajectory."""

    def __init__(self, _: object) -> None:
        self.reset()

    def reset(self) -> None:
        self._odometry: VisualOdometry | None = None
        self._shape: tuple[int, int] = (0, 0)
        self._poses: list[VisualPose] = []

    def step(self, image: Image, params: object) -> dict[str, Message]:
        """The way so far."""
        seen = work_of(image, _Seen)
        if self._odometry is None or self._shape != seen.shape:
            self.reset()
            self._shape = seen.shape
            info = CameraInfo(*seen.shape, seen.K)
            self._odometry = VisualOdometry([info], None, VisualSettings(is_guessed=True))
        found = self._odometry.step(image.header.stamp_ns, seen.gray)
        if found is not None and not found.is_lost:
            self._poses.append(found)
        if len(self._poses) < 2:
            images = self._odometry.counts["images"]
            return show(image, seen.bgr, _ONE if images < 2 else _reason(self._odometry.reason))
        return self._shown(image, self._odometry.counts)

    def _shown(self, image: Image, counts: dict[str, int]) -> dict[str, Message]:
        places = np.array([one.p for one in self._poses])
        steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
        ways = np.concatenate([[0.0], np.cumsum(steps)])
        half = int(np.searchsorted(ways, ways[-1] / 2))
        middle, last = (_deviations(self._poses[n]) for n in (half, -1))
        text = f"""
            Each step is a little wrong, and begins where the previous one ended: the errors add
            up. To keep them small, corners are followed through many pictures, and the views that
            see the same corners (keyframes) are fitted together. The remaining error grows, and its
            covariance with it. Lengths are in units of the first step.

            After {counts["images"]} pictures with {counts["keyframes"]} keyframes the trajectory is
            {ways[-1]:.2f} long. The standard deviation of the last pose is {last[0]:.2f}
            ({100 * last[0] / max(ways[-1], 1e-9):.1f} % of the length) and {last[1]:.2f}°; half-way
            it was {middle[0]:.2f} and {middle[1]:.2f}°. Tracking was lost {counts["losses"]} times.
            The figure shows the trajectory in the first camera's axes, with ellipses of two
            standard deviations.

            Only outside information stops the drift: GPS, a landmark on a map, or a known place
            that the camera sees again.
            """
        return show(image, draw_way(self._poses), text)


LESSON = Lesson(
    "odometry",
    "how a camera estimates its motion: corners, optical flow, epipolar lines, scale, drift",
    """
    A moving camera sees near things pass quickly and far things slowly. Its trajectory can be
    computed from this alone; this is called visual odometry. The steps show how, on a video of
    {width} × {height} pixels.
    """,
    [
        Step(GridCorners),
        Step(flow, "corners"),
        Step(Epipolar, "corners"),
        Step(scale, "epipolar"),
        Step(WayDrift, "corners"),
    ],
    plays=True,
    export_s=10.0,
)

_ONE = "One picture shows no motion. Open a video, or start playback."
_LOST = "The view has changed too much: hardly any corners of the previous pictures are left."
_NOTHING = "No motion; see the previous step."
_REASONS = {
    "waiting for motion": "The camera is at rest or only turns, so its trajectory and all "
    "depths are unknown.",
    "too few corners": "Too few corners were found again to compute a motion.",
    "moving objects fill most of the image": "Things move in most of the picture, each in its"
    " own way, "
    "so it is not the camera that moves.",
}


def _reason(why: str) -> str:
    return _REASONS.get(why, f"No motion of the camera was found: {why}.")


def _is_common(first: _FirstView, now: _FirstView) -> bool:
    common = np.isin(now.corners.ids, first.corners.ids).sum()
    return bool(common >= max(_LEAST, _COMMON * len(first.corners.ids)))


def _deviations(pose: VisualPose) -> tuple[float, float]:
    """Standard deviations of a pose's place, and of its rotation in degrees."""
    change = se3.about_itself(pose.p)
    spread = np.diag(change @ pose.covariance @ change.T).clip(min=0)
    return float(np.sqrt(spread[:3].sum())), float(np.degrees(np.sqrt(spread[3:].sum())))

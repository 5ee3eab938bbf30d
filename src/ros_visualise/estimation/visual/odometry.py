"""Visual odometry: the motion of a camera by what it sees.

Corners are followed from image to image. Two views with enough parallax begin a map of points; each
image is located by these; keyframes, wherever the view has changed enough, add points and are
adjusted together. What a camera alone cannot see, its scale, comes from the height over the ground,
from positions that something else measures, or from a second camera; without these lengths have no
unit.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ros_visualise.data import CameraInfo, Floats, Pixels
from ros_visualise.estimation.resting import Indices
from ros_visualise.estimation.visual.background import MOVING_THINGS, background_rests
from ros_visualise.estimation.visual.rolling import directions_at_once
from ros_visualise.estimation.visual.scale import ScaleFinder
from ros_visualise.estimation.visual.starting import STILL, FirstMotion, first_motions
from ros_visualise.estimation.visual.stretch import Stretch, VisualPose
from ros_visualise.estimation.visual.turning import TURNING, only_turned
from ros_visualise.estimation.visual.window import (
    Keyframe,
    KeyframeDistance,
    KeyframeWindow,
    Located,
)
from ros_visualise.geometry import se3
from ros_visualise.landmarks.pose.rays import rays_of
from ros_visualise.vision.picture import FROZEN, PictureJudge
from ros_visualise.vision.rectification import Interpolation, model_of, rectify
from ros_visualise.vision.tracking import CornerTracker, FollowedCorners, flow

_NEW_VIEW, _NEAR = 0.05, 0.8  # parallax of a new keyframe, rad; its quantile: near corners show it
_FEWER = 0.7  # of a keyframe's points in view, below which another one is needed
_LEAST_USED = 12  # points that locate an image
_AGREED = 0.5  # of those in view
_EXACT, _WEAK = 1e-3, 0.3  # fractions: of a baseline that defines the unit, or is replaced
_FLAT, _ALONG = 0.04, 0.85  # thickness of a plane, by its depth; cosine of a way along its normal
_AS_GOOD = 1.15  # residuals of two first motions that cannot be told apart
_BELIEVED = 6  # keyframes of a stretch; a shorter one was a mistake
_PROVEN = 18  # the same, of one whose first part is kept though its end is wrong
_PASSED = 4  # keyframes after which the background must have moved
_CUT = "the whole view changes at once, as at a cut in a video"
_UNFIT = "most of the image does not fit: things move, or the view has changed"
_LEFT = 0.1  # of the corners, at a cut
_ANYWHERE = 3  # extents of the path: where the camera may be after a cut
_MOST_WAITING = 600  # images between the first two keyframes
_PATIENCE = 3  # images in a row that do not fit
_LONGEST_S = 1.0  # without a usable image
_LEAST_SPEED, _TURNING = 0.1, 0.2  # units/s and rad/s: what may happen while lost
_SURELY = 1e-9  # variance of the first pose
_SIGMA_PX = 0.4, 1.0  # standard deviation of corners, and with a lens that is guessed


@dataclass(frozen=True)
class VisualSettings:
    """Settings of `VisualOdometry`.

    Attributes:
        corners: number followed.
        height: of the camera over the ground, metres; 0: unknown.
        height_sigma: its standard deviation, as a fraction.
        down: (3,) direction of the ground in the camera's axes, as far as it is known.
        readout_s: time from the first to the last row of an image.
        is_guessed: the calibration is a guess.
        has_positions: `VisualOdometry.measured` will give the scale.
    """

    corners: int = 250
    height: float = 0.0
    height_sigma: float = 0.01
    down: tuple[float, float, float] = (0.0, 1.0, 0.0)
    readout_s: float = 0.0
    is_guessed: bool = False
    has_positions: bool = False


class _Image(NamedTuple):
    """An image with the directions of its corners (N, 2); ``right`` is that of a second camera."""

    stamp_ns: int
    gray: Pixels
    right: Pixels | None
    corners: FollowedCorners
    rays: Floats


class VisualOdometry:
    """See the module.

    Args:
        infos: calibrations of one camera, or of two.
        cameras: T_left_camera (C, 4, 4).
        settings: see `VisualSettings`.

    Attributes:
        reason: why the last image has no pose; empty if it has one.
        counts: numbers of images, keyframes and losses.
        start_ns: stamp of the first view, in whose frame all poses are.
        motion_covariance: (6, 6) of the twist from the image before to the last, in its axes.
        done: poses that change no more, in order of their stamps; to be cleared by who takes them.
    """

    def __init__(
        self,
        infos: Sequence[CameraInfo],
        cameras: Floats | None = None,
        settings: VisualSettings | None = None,
    ) -> None:
        self.settings = settings or VisualSettings()
        self.counts = {"images": 0, "keyframes": 0, "losses": 0}
        self.done: list[VisualPose] = []
        self.reason = STILL
        self._infos = infos
        self._cameras = np.eye(4)[None] if cameras is None else cameras
        self._model = model_of(infos[0], -1)
        K = infos[0].K
        pixel_sigma = _SIGMA_PX[self.settings.is_guessed]
        self._sigma = pixel_sigma / float(np.sqrt(K[0, 0] * K[1, 1]))
        self._judge, self._tracker = PictureJudge(), CornerTracker(self.settings.corners)
        own = self.settings
        down = np.array(own.down)
        self._scales = ScaleFinder(self._model.P[:, :3], own.height, down, own.has_positions)
        self._stretch: Stretch | None = None
        self._first: _Image | None = None
        self._waiting: deque[_Image] = deque(maxlen=_MOST_WAITING)
        self._last = VisualPose(0, np.eye(3), np.zeros(3), np.eye(6) * _SURELY, False)
        self._is_begun = self._is_doubted = False
        self._here, self._step = _NOWHERE, _NOWHERE
        self.motion_covariance = np.eye(6)
        self._residuals: deque[float] = deque(maxlen=1000)
        self._speed = self._extent = 0.0
        self._key = self._followed = self._failures = 0
        self._before_ns = self._seen_ns = self._opened_ns = self.start_ns = 0

    def measured(self, stamp_ns: int, position: Floats, sigma: float) -> None:
        """Note a position (3,) of something that moves with the camera, in any frame."""
        self._scales.add(stamp_ns, position, sigma)

    def step(self, stamp_ns: int, gray: Pixels, right: Pixels | None = None) -> VisualPose | None:
        """The pose of an image (H, W), uint8; None before the first motion."""
        self.counts["images"] += 1
        before_ns, self._before_ns = self._before_ns, stamp_ns
        fault = self._judge.fault(gray)
        if fault:
            return self._coast(stamp_ns, fault)
        known = len(self._tracker.corners.ids)
        corners = self._tracker.follow(gray)
        rays = self._rays(corners, (stamp_ns - before_ns) / 1e9)
        image = _Image(stamp_ns, gray, right, corners, rays)
        if self._stretch is not None:
            if len(corners.ids) < _LEFT * known:
                return self._cut(self._stretch, image)
            return self._go_on(self._stretch, image)
        return self._begin(image, before_ns) if right is None else self._begin_by_two(image)

    def finish(self) -> list[VisualPose]:
        """All poses that are not taken yet, at the end."""
        if self._stretch is not None and not (self._is_doubted and self._is_short(self._stretch)):
            self.done += self._stretch.taken(all_of_it=True)
        self._stretch = None
        return self.done

    @property
    def residual(self) -> float:
        """Mean residual of keyframes, as a direction."""
        return float(np.mean(self._residuals)) if self._residuals else self._sigma

    def points(self) -> Floats:
        """(N, 3) the points of the map, in the frame of the first image."""
        if self._stretch is None:
            return np.zeros((0, 3))
        return self._stretch.points()

    @property
    def newest(self) -> Keyframe | None:
        """The last keyframe of the present map; None without one."""
        return None if self._stretch is None else self._stretch.window.newest

    @property
    def camera(self) -> Floats:
        """(3, 3) K of the images of keyframes."""
        K: Floats = self._model.P[:, :3]
        return K

    @property
    def corners(self) -> FollowedCorners:
        """The corners in the last image."""
        return self._tracker.corners

    # directions

    def _rays(self, corners: FollowedCorners, seconds: float) -> Floats:
        """(N, 2) directions of corners, as if all rows were read at once."""
        return directions_at_once(corners, self._infos[0], self.settings.readout_s, seconds)

    def _directions(self, pixels: Floats, camera: int) -> Floats:
        rays = rays_of(pixels, self._infos[camera]).directions
        return rays[:, :2] / rays[:, 2:]

    def _both(self, image: _Image) -> Floats:
        """(C, N, 2) directions of the corners of an image by all cameras."""
        if image.right is None:
            return np.array([image.rays])
        pixels, found = flow(image.gray, image.right, image.corners.pixels_uv)
        right = np.where(found[:, None], self._directions(pixels, 1), np.nan)
        return np.stack([image.rays, right])

    # the first motion

    def _at_stamp(self, first: _Image, image: _Image) -> _Image:
        """The first image, its corners as if all rows were read at once, by where they go then."""
        _, a, b = np.intersect1d(first.corners.ids, image.corners.ids, True, return_indices=True)
        corners, after = first.corners.chosen(a), image.corners.pixels_uv[b]
        turned = FollowedCorners(corners.ids, corners.pixels_uv, 2 * corners.pixels_uv - after)
        rays = self._rays(turned, (image.stamp_ns - first.stamp_ns) / 1e9)
        return first._replace(corners=corners, rays=rays)

    def _begin(self, image: _Image, before_ns: int) -> VisualPose | None:
        """Begin a map, if this image shows a motion since the first one."""
        first = self._first
        if first is None:
            return self._wait(image, self.reason)
        if self.settings.readout_s and first.stamp_ns == before_ns:
            self._first = first = self._at_stamp(first, image)
        common, a, b = np.intersect1d(first.corners.ids, image.corners.ids, return_indices=True)
        motions = self._first_motions(first.rays[a], image.rays[b])
        if isinstance(motions, str):
            if len(common) <= 0.5 * len(first.corners.ids):
                return self._wait(image, motions)
            self._waiting.append(image._replace(gray=_NO_PIXELS))
            return self._coast(image.stamp_ns, motions)
        if not self._waiting:  # a third view, which checks what two show
            self._waiting.append(image._replace(gray=_NO_PIXELS))
            return self._coast(image.stamp_ns, self.reason)
        windows = [self._first_window(first, image, a, b, one) for one in motions]
        scores = [self._misfit(one) for one in windows]
        if min(scores) > 1:
            return self._wait(image, "no rigid motion fits")
        turns = [np.linalg.norm(se3.rotation_vector(one.newest.R)) for one in windows]
        good = [n for n, score in enumerate(scores) if score < _AS_GOOD * min(scores)]
        window = windows[min(good, key=lambda n: turns[n])]  # of a plane's, the likely one
        if _is_ambiguous(window):
            self._waiting.append(image._replace(gray=_NO_PIXELS))
            return self._coast(image.stamp_ns, "waiting for sideways motion")
        if background_rests(first.gray, image.gray, at_first=True):
            return self._wait(image, MOVING_THINGS)
        stretch = self._open(window, first.stamp_ns)
        for one in window.frames[:-1]:
            stretch.covariances[one.key] = np.zeros((6, 6))
            stretch.between[one.key] = self._located(window, first.stamp_ns)
        return self._settle(stretch, image)

    def _first_motions(self, first: Floats, second: Floats) -> list[FirstMotion] | str:
        """The motions between two views, or why none."""
        motions = first_motions(first, second, self._sigma)
        if isinstance(motions, str):
            return motions
        info = self._infos[0]
        guess = float(info.K[0, 0]) / info.width * self.settings.is_guessed
        return TURNING if only_turned(first, second, self._sigma, guess) else motions

    def _first_window(
        self, first: _Image, image: _Image, a: Indices, b: Indices, motion: FirstMotion
    ) -> KeyframeWindow:
        """A map of two views."""
        length = self._speed * (image.stamp_ns - first.stamp_ns) / 1e9 or 1.0
        window = KeyframeWindow(self._sigma, self._cameras)
        a, b = a[motion.agree], b[motion.agree]
        second = motion.R.T, -motion.R.T @ motion.t * length
        for one, places, (R, p) in ((first, a, _NOWHERE), (image, b, second)):
            corners = one.corners.chosen(places)
            window.add(self._keyframe(one._replace(corners=corners, rays=one.rays[places]), R, p))
        sigma = length * (_WEAK if self._scales.is_needed or self._speed else _EXACT)
        window.distances.append(KeyframeDistance(self._key - 2, self._key - 1, length, sigma))
        window.adjust()
        return window

    def _misfit(self, window: KeyframeWindow) -> float:
        """Residual of a first map, and of an image between its views, in standard deviations."""
        middle = self._waiting[len(self._waiting) // 2]
        found = window.locate(*_NOWHERE, middle.corners.ids, middle.rays)
        if found is None or found.used < max(_LEAST_USED, _AGREED * found.seen):
            return np.inf
        return max(window.residual(), found.residual * found.seen / found.used) / self._sigma

    def _located(self, window: KeyframeWindow, from_ns: int) -> list[VisualPose]:
        """Poses, in the first keyframe, of the images between it and the second."""
        found = []
        R, p = _NOWHERE
        for one in self._waiting:
            at = window.locate(R, p, one.corners.ids, one.rays)
            if one.stamp_ns > from_ns and at is not None and at.used > _AGREED * at.seen:
                R, p = at.R, at.p
                found.append(VisualPose(one.stamp_ns, R, p, at.covariance, False))
        self._waiting.clear()
        return found

    def _begin_by_two(self, image: _Image) -> VisualPose | None:
        """Begin a map by one image of two cameras."""
        corners = self._tracker.refill()
        image = image._replace(corners=corners, rays=self._rays(corners, 0.0))
        window = KeyframeWindow(self._sigma, self._cameras)
        window.add(self._keyframe(image, *_NOWHERE))
        if len(window.points.ids) < _LEAST_USED:
            return self._coast(image.stamp_ns, "too few corners")
        return self._settle(self._open(window, image.stamp_ns), image)

    def _wait(self, image: _Image, reason: str) -> VisualPose | None:
        """Wait for a motion from this image on."""
        corners = self._tracker.refill()
        self._first = image._replace(corners=corners, rays=self._rays(corners, 0.0))
        self._waiting.clear()
        return self._coast(image.stamp_ns, reason)

    def _open(self, window: KeyframeWindow, stamp_ns: int) -> Stretch:
        start = self._coasted(stamp_ns) if self._is_begun else self._last
        if not self._is_begun:
            self.start_ns = stamp_ns
        self._stretch = Stretch(window, start, len(self._cameras) > 1)
        self._stretch.scale_sigma = self.settings.height_sigma * bool(self.settings.height)
        self._scales.restart()
        self._opened_ns = stamp_ns
        self._step = _NOWHERE
        self._is_begun = True
        return self._stretch

    # the motion from image to image

    def _go_on(self, stretch: Stretch, image: _Image) -> VisualPose | None:
        window = stretch.window
        R, p = _product(self._here, self._step)
        found = window.locate(R, p, image.corners.ids, image.rays)
        if found is None or found.used < max(_LEAST_USED, _AGREED * found.seen):
            return self._miss(stretch, image, found)
        self._step = _product(_inverse(self._here), (found.R, found.p))
        back = se3.adjoint(*_inverse((found.R, found.p)))
        self.motion_covariance = 2 * back @ found.covariance @ back.T
        self._here = found.R, found.p
        if self._is_new_view(stretch, image, found):
            window.add(self._keyframe(image, found.R, found.p))
            if not window.adjust():
                window.frames.pop()
                self._lose(stretch)
                return self._wait(image, _UNFIT)
            if len(window.frames) >= _PASSED and _is_before_background(window):
                return self._disbelieve(stretch, image)
            return self._settle(stretch, image)
        newest = window.newest
        R, p = _product(_inverse((newest.R, newest.p)), self._here)
        back = se3.adjoint(*_inverse((newest.R, newest.p)))
        own = back @ found.covariance @ back.T
        stretch.between[newest.key].append(VisualPose(image.stamp_ns, R, p, own, False))
        return self._seen(stretch.at(image.stamp_ns, *self._here, found.covariance))

    def _is_new_view(self, stretch: Stretch, image: _Image, found: Located) -> bool:
        """True if the view has changed enough since the newest keyframe."""
        newest = stretch.window.newest
        common, a, b = np.intersect1d(newest.ids, image.corners.ids, return_indices=True)
        if len(common) < _FEWER * self._followed or found.used < 4 * _LEAST_USED:
            return True
        back = found.R.T @ newest.R
        turned = newest.rays[0, a] @ back[:, :2].T + back[:, 2]
        away = np.linalg.norm(image.rays[b] - turned[:, :2] / turned[:, 2:], axis=1)
        return float(np.nanquantile(away, _NEAR)) > _NEW_VIEW

    def _keyframe(self, image: _Image, R: Floats, p: Floats) -> Keyframe:
        self._key += 1
        gray = rectify(image.gray, self._model, Interpolation.LINEAR)
        ids, rays = image.corners.ids, self._both(image)
        return Keyframe(self._key - 1, image.stamp_ns, R, p, ids, rays, gray)

    def _settle(self, stretch: Stretch, image: _Image) -> VisualPose:
        """MeasuredScale the map, drop its oldest keyframe, and see new corners."""
        self._scales.look(stretch)
        stretch.settle()
        window = stretch.window
        self._tracker.drop(window.lost)
        self.counts["keyframes"] += 1
        self._is_doubted &= self._is_short(stretch)
        self._residuals.append(window.residual())
        self._here = window.newest.R, window.newest.p
        if not self._is_doubted and (not self._scales.is_needed or stretch.in_metres):
            self.done += stretch.taken()
        corners = self._tracker.refill()
        corners = corners.chosen(~np.isin(corners.ids, window.newest.ids))
        if not self.settings.readout_s:
            rays = self._both(image._replace(corners=corners, rays=self._rays(corners, 0.0)))
            window.newest.see(corners.ids, rays)
        self._followed = int(np.isin(self._tracker.corners.ids, window.newest.ids).sum())
        return self._seen(stretch.at(image.stamp_ns, *self._here, np.zeros((6, 6))))

    def _seen(self, pose: VisualPose) -> VisualPose:
        """A pose by an image, and the speed up to it."""
        seconds = (pose.stamp_ns - self._last.stamp_ns) / 1e9
        if 0 < seconds < _LONGEST_S and pose.in_metres == self._last.in_metres:
            self._speed = float(np.linalg.norm(pose.p - self._last.p)) / seconds
        self._failures, self.reason, self._seen_ns = 0, "", pose.stamp_ns
        self._last = pose
        self._extent = max(self._extent, float(np.linalg.norm(pose.p)))
        return pose

    # losses

    def _miss(self, stretch: Stretch, image: _Image, found: Located | None) -> VisualPose | None:
        """An image that does not fit; after some of them the map is given up."""
        self._failures += 1
        reason = "too few corners" if found is None or found.seen < 2 * _LEAST_USED else _UNFIT
        if self._failures >= _PATIENCE:
            self._lose(stretch)
            return self._wait(image, reason)
        return self._coast(image.stamp_ns, reason)

    def _disbelieve(self, stretch: Stretch, image: _Image) -> VisualPose | None:
        """Give up a map whose last keyframes are of things that move."""
        self._is_doubted = True
        stretch.window.frames.clear()
        if len(stretch.covariances) < _PROVEN:
            stretch.left.clear()
            stretch.covariances.clear()
            self.done = [one for one in self.done if one.stamp_ns < self._opened_ns]
        self._lose(stretch)
        return self._wait(image, MOVING_THINGS)

    def _cut(self, stretch: Stretch, image: _Image) -> VisualPose | None:
        """Give up a map: this image is of another place, or of the same one from elsewhere."""
        self._lose(stretch)
        last = self._last
        own = np.diag(np.repeat([(_ANYWHERE * self._extent) ** 2, np.pi**2], 3))
        change = se3.about_origin(last.p)
        self._last = last._replace(covariance=last.covariance + change @ own @ change.T)
        return self._wait(image, _CUT)

    def _is_short(self, stretch: Stretch) -> bool:
        """True if a stretch would be a mistake, if it ended; sooner so after one."""
        return len(stretch.covariances) < _BELIEVED * (1 + self._is_doubted)

    def _lose(self, stretch: Stretch) -> None:
        if not self._is_short(stretch):
            self.done += stretch.taken(all_of_it=True)
        else:
            self._last = stretch.start
            self._is_begun = self._last.stamp_ns > 0
        self._stretch, self._first = None, None
        self.counts["losses"] += 1
        self._tracker.drop(self._tracker.corners.ids)

    def _coast(self, stamp_ns: int, reason: str) -> VisualPose | None:
        """The last pose, with what may have happened since; None before the first one."""
        self.reason = reason
        is_long = stamp_ns - self._seen_ns > _LONGEST_S * 1e9
        if self._stretch is not None and is_long and reason != FROZEN:
            self._lose(self._stretch)
        return self._coasted(stamp_ns) if self._is_begun else None

    def _coasted(self, stamp_ns: int) -> VisualPose:
        seconds = max(stamp_ns - self._last.stamp_ns, 0) / 1e9
        way = (self._speed + _LEAST_SPEED) * seconds
        own = np.diag(np.repeat([way**2, min(_TURNING * seconds, np.pi) ** 2], 3))
        change = se3.about_origin(self._last.p)
        covariance = self._last.covariance + change @ own @ change.T
        return self._last._replace(stamp_ns=stamp_ns, covariance=covariance, is_lost=True)


def _is_before_background(window: KeyframeWindow) -> bool:
    """True if near points have passed, and the background has not moved at all."""
    newest = window.newest
    far = max(window.frames, key=lambda one: float(np.linalg.norm(one.p - newest.p)))
    away = np.linalg.norm(window.positions() - newest.p, axis=1)
    way = float(np.linalg.norm(far.p - newest.p))
    has_passed = way * np.quantile(1 / away, _NEAR) > 2 * _NEW_VIEW
    return bool(has_passed) and background_rests(far.gray, newest.gray)


def _is_ambiguous(window: KeyframeWindow) -> bool:
    """True if the way is along the normal of a plane: both motions that fit it are alike then.

    A turn by degrees fits as well, with a plane and a way that are tilted.
    """
    rays, rho = np.insert(window.points.values[:, :2], 2, 1.0, axis=1), window.points.values[:, 2]
    m: Floats = np.zeros(3)
    w: Floats = np.ones(len(rho))
    off: Floats = np.abs(rho)
    for _ in range(5):  # a plane m'x = 1 is seen at the inverse depths m'ray
        m = np.asarray(np.linalg.lstsq(rays * w[:, None], rho * w, rcond=None)[0])
        off = np.abs(rays @ m - rho)
        w = 1 / (1 + off / max(float(np.median(off)), 1e-12))
    way = window.newest.p - window.frames[0].p
    along = abs(float(m @ way)) / max(float(np.linalg.norm(m) * np.linalg.norm(way)), 1e-12)
    return bool(np.median(off) < _FLAT * np.median(rho) and along > _ALONG)


_Rigid = tuple[Floats, Floats]
_NOWHERE: _Rigid = np.eye(3), np.zeros(3)
_NO_PIXELS: Pixels = np.zeros((0, 0), np.uint8)


def _product(a: _Rigid, b: _Rigid) -> _Rigid:
    return a[0] @ b[0], a[0] @ b[1] + a[1]


def _inverse(a: _Rigid) -> _Rigid:
    return a[0].T, -a[0].T @ a[1]

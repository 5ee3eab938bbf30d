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

import numpy as np

from ros_visualise.data import CameraInfo, Floats, Pixels
from ros_visualise.estimation.visual.background import MOVING_THINGS, background_rests
from ros_visualise.estimation.visual.first_map import (
    AGREED,
    LEAST_USED,
    NOWHERE,
    FirstMap,
    MapWaits,
)
from ros_visualise.estimation.visual.keyframes import Keyframe
from ros_visualise.estimation.visual.locating import Located
from ros_visualise.estimation.visual.scale import ScaleFinder
from ros_visualise.estimation.visual.sights import CameraSights, SeenImage
from ros_visualise.estimation.visual.starting import STILL
from ros_visualise.estimation.visual.stretch import Stretch, VisualPose
from ros_visualise.estimation.visual.window import KeyframeWindow
from ros_visualise.geometry import se3
from ros_visualise.vision.picture import FROZEN, PictureJudge
from ros_visualise.vision.tracking import CornerTracker, FollowedCorners

_NEW_VIEW, _NEAR = 0.05, 0.8  # parallax of a new keyframe, rad; its quantile: near corners show it
_FEWER = 0.7  # of a keyframe's points in view, below which another one is needed
_BELIEVED = 6  # keyframes of a stretch; a shorter one was a mistake
_PROVEN = 18  # the same, of one whose first part is kept though its end is wrong
_PASSED = 4  # keyframes after which the background must have moved
_CUT = "the whole view changes at once, as at a cut in a video"
_UNFIT = "most of the image does not fit: things move, or the view has changed"
_LEFT = 0.1  # of the corners, at a cut
_ANYWHERE = 3  # extents of the path: where the camera may be after a cut
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
        self._cameras = np.eye(4)[None] if cameras is None else cameras
        self._sights = CameraSights(infos, self.settings.readout_s)
        K = infos[0].K
        pixel_sigma = _SIGMA_PX[self.settings.is_guessed]
        self._sigma = pixel_sigma / float(np.sqrt(K[0, 0] * K[1, 1]))
        self._judge, self._tracker = PictureJudge(), CornerTracker(self.settings.corners)
        own = self.settings
        down = np.array(own.down)
        self._scales = ScaleFinder(self._sights.camera, own.height, down, own.has_positions)
        self._stretch: Stretch | None = None
        self._first = FirstMap(self._sights, self._sigma, self._cameras, own.is_guessed)
        self._last = VisualPose(0, np.eye(3), np.zeros(3), np.eye(6) * _SURELY, False)
        self._is_begun = self._is_doubted = False
        self._here, self._step = NOWHERE, NOWHERE
        self.motion_covariance = np.eye(6)
        self._residuals: deque[float] = deque(maxlen=1000)
        self._speed = self._extent = 0.0
        self._followed = self._failures = 0
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
        rays = self._sights.rays(corners, (stamp_ns - before_ns) / 1e9)
        image = SeenImage(stamp_ns, gray, right, corners, rays)
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
        return self._sights.camera

    @property
    def corners(self) -> FollowedCorners:
        """The corners in the last image."""
        return self._tracker.corners

    # the first motion

    def _begin(self, image: SeenImage, before_ns: int) -> VisualPose | None:
        """Begin a map, if this image shows a motion since the first one."""
        found = self._first.look(image, before_ns, self._speed, self._scales.is_needed)
        if isinstance(found, MapWaits):
            reason = found.reason or self.reason
            if found.is_over:
                return self._wait(image, reason)
            return self._coast(image.stamp_ns, reason)
        stretch = self._open(found.window, found.first_ns)
        for one in found.window.frames[:-1]:
            stretch.covariances[one.key] = np.zeros((6, 6))
            stretch.between[one.key] = found.between
        return self._settle(stretch, image)

    def _begin_by_two(self, image: SeenImage) -> VisualPose | None:
        """Begin a map by one image of two cameras."""
        corners = self._tracker.refill()
        image = image._replace(corners=corners, rays=self._sights.rays(corners, 0.0))
        window = KeyframeWindow(self._sigma, self._cameras)
        window.add(self._sights.keyframe(image, *NOWHERE))
        if len(window.points.ids) < LEAST_USED:
            return self._coast(image.stamp_ns, "too few corners")
        return self._settle(self._open(window, image.stamp_ns), image)

    def _wait(self, image: SeenImage, reason: str) -> VisualPose | None:
        """Wait for a motion from this image on."""
        corners = self._tracker.refill()
        self._first.restart(image._replace(corners=corners, rays=self._sights.rays(corners, 0.0)))
        return self._coast(image.stamp_ns, reason)

    def _open(self, window: KeyframeWindow, stamp_ns: int) -> Stretch:
        start = self._coasted(stamp_ns) if self._is_begun else self._last
        if not self._is_begun:
            self.start_ns = stamp_ns
        self._stretch = Stretch(window, start, len(self._cameras) > 1)
        self._stretch.scale_sigma = self.settings.height_sigma * bool(self.settings.height)
        self._scales.restart()
        self._opened_ns = stamp_ns
        self._step = NOWHERE
        self._is_begun = True
        return self._stretch

    # the motion from image to image

    def _go_on(self, stretch: Stretch, image: SeenImage) -> VisualPose | None:
        window = stretch.window
        R, p = _product(self._here, self._step)
        found = window.locate(R, p, image.corners.ids, image.rays)
        if found is None or found.used < max(LEAST_USED, AGREED * found.seen):
            return self._miss(stretch, image, found)
        self._step = _product(_inverse(self._here), (found.R, found.p))
        back = se3.adjoint(*_inverse((found.R, found.p)))
        self.motion_covariance = 2 * back @ found.covariance @ back.T
        self._here = found.R, found.p
        if self._is_new_view(stretch, image, found):
            window.add(self._sights.keyframe(image, found.R, found.p))
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

    def _is_new_view(self, stretch: Stretch, image: SeenImage, found: Located) -> bool:
        """True if the view has changed enough since the newest keyframe."""
        newest = stretch.window.newest
        common, a, b = np.intersect1d(newest.ids, image.corners.ids, return_indices=True)
        if len(common) < _FEWER * self._followed or found.used < 4 * LEAST_USED:
            return True
        back = found.R.T @ newest.R
        turned = newest.rays[0, a] @ back[:, :2].T + back[:, 2]
        away = np.linalg.norm(image.rays[b] - turned[:, :2] / turned[:, 2:], axis=1)
        return float(np.nanquantile(away, _NEAR)) > _NEW_VIEW

    def _settle(self, stretch: Stretch, image: SeenImage) -> VisualPose:
        """Scale the map, drop its oldest keyframe, and see new corners."""
        self._scales.look(stretch)
        stretch.settle()
        window = stretch.window
        self._tracker.drop(window.lost)
        self.counts["keyframes"] += 1
        self._is_doubted &= self._is_short(stretch)
        self._residuals.append(window.residual)
        self._here = window.newest.R, window.newest.p
        if not self._is_doubted and (not self._scales.is_needed or stretch.in_metres):
            self.done += stretch.taken()
        corners = self._tracker.refill()
        corners = corners.chosen(~np.isin(corners.ids, window.newest.ids))
        if not self.settings.readout_s:
            rays = self._sights.both(
                image._replace(corners=corners, rays=self._sights.rays(corners, 0.0))
            )
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

    def _miss(self, stretch: Stretch, image: SeenImage, found: Located | None) -> VisualPose | None:
        """An image that does not fit; after some of them the map is given up."""
        self._failures += 1
        reason = "too few corners" if found is None or found.seen < 2 * LEAST_USED else _UNFIT
        if self._failures >= _PATIENCE:
            self._lose(stretch)
            return self._wait(image, reason)
        return self._coast(image.stamp_ns, reason)

    def _disbelieve(self, stretch: Stretch, image: SeenImage) -> VisualPose | None:
        """Give up a map whose last keyframes are of things that move."""
        self._is_doubted = True
        stretch.window.frames.clear()
        if len(stretch.covariances) < _PROVEN:
            stretch.left.clear()
            stretch.covariances.clear()
            self.done = [one for one in self.done if one.stamp_ns < self._opened_ns]
        self._lose(stretch)
        return self._wait(image, MOVING_THINGS)

    def _cut(self, stretch: Stretch, image: SeenImage) -> VisualPose | None:
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
        self._stretch = None
        self._first.restart(None)
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


_Rigid = tuple[Floats, Floats]


def _product(a: _Rigid, b: _Rigid) -> _Rigid:
    return a[0] @ b[0], a[0] @ b[1] + a[1]


def _inverse(a: _Rigid) -> _Rigid:
    return a[0].T, -a[0].T @ a[1]

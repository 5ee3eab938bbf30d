"""Visual-inertial odometry: the motion of a robot, in metres, by one camera and an IMU.

Corners are followed from image to image, as in `ros_visualise.estimation.visual`; a filter joins
them with the IMU. It begins at rest, or in motion that shows the scale. The frame ``odom`` is level
(z up); the robot starts at its origin, heading along x.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np

from ros_visualise.data import CameraInfo, Floats, Pixels
from ros_visualise.estimation.imu import ImuBuffer, Mounting
from ros_visualise.estimation.inertial.filter import InertialFilter, InertialSettings
from ros_visualise.estimation.inertial.moving import start_in_motion
from ros_visualise.estimation.inertial.sliding import MOTION, RATE_BIAS
from ros_visualise.estimation.inertial.starting import (
    FirstEstimate,
    SeenCorners,
    start_at_rest,
)
from ros_visualise.estimation.resting import Indices
from ros_visualise.estimation.robot import POSE
from ros_visualise.estimation.visual.rolling import directions_by_rows
from ros_visualise.geometry import se3
from ros_visualise.landmarks.pose.rays import rays_of
from ros_visualise.vision.picture import PictureJudge
from ros_visualise.vision.tracking import CornerTracker, FollowedCorners

_PERIOD_NS = 70_000_000  # shortest time between views
_REST_NS, _STEP_NS = 500_000_000, 100_000_000  # of rest before the start, and its steps
_LEAST_STILL_S = 0.5  # of a rest that corrects: a slow climb looks like one for an image or two
_LEAST_REST_NS = 80_000_000  # of a rest with which all begins
_QUIET_FORCE, _QUIET_RATES = 0.15, 0.02  # m/s^2 and rad/s: spread at rest
_SAME_FORCE, _SLOW = 0.1, 0.05  # m/s^2 and rad/s: of means at rest
_STILL_PX, _STILL_LEVELS = 0.7, 1.5  # of corners, or gray levels, since the rest began
_LEAST = 8  # corners that hold the estimate
_LOST_NS, _WRONG_NS = 1_000_000_000, 4_000_000_000  # without these: it may, or must, be wrong
_FASTEST_MOUNT = 20.0  # rad/s
_WIDEST = 0.64  # cosine of 50 degrees, the part of a fisheye that is used
_MOST_WAITING = 15  # images, for the IMU
_LOST_SPEED, _LOST_TURN = 1.0, 0.3  # m/s and rad/s: what may happen in a gap of the IMU
_MOVES = "waiting for the robot to rest for half a second, or to speed up, slow down or turn"
_LEAST_MOVING, _MOST_MOVING, _EVERY = 15, 20, 5  # views for a start in motion; those between tries
_SELDOM_S = 0.125  # mean time between images, above which the focal length is estimated wrong
_USUAL = 50  # images, of which that is the mean
_GAP_S = 1.0  # a longer time between two images is a gap, and counts as so much
_THIN = 1 / 8  # size of images that are compared at rest


class InertialPose(NamedTuple):
    """Pose T_odom_base of the robot at an image, its velocities, and its covariances.

    Attributes:
        linear, angular: (3,) m/s and rad/s, in the robot's axes.
        covariance: (6, 6) of the twist of the pose, in ``odom``.
        of_twist: (6, 6) of the velocities.
        is_lost: True if no corners hold it, so that its error grows.
    """

    stamp_ns: int
    R: Floats
    p: Floats
    linear: Floats
    angular: Floats
    covariance: Floats
    of_twist: Floats
    is_lost: bool


class _SeenImage(NamedTuple):
    stamp_ns: int
    gray: Pixels
    T_base_camera: Floats
    turning: Floats


class InertialOdometry:
    """See the module.

    Args:
        info: calibration of the camera.
        settings: see `InertialSettings`.
        corners: number that is followed.

    Attributes:
        reason: why the last image has no pose, or a worse one; empty if all is well.
        counts: numbers of images, losses and gaps of the IMU.
        filter: the estimate; None before the start.
    """

    def __init__(
        self,
        info: CameraInfo,
        settings: InertialSettings | None = None,
        corners: int = 200,
    ) -> None:
        self.settings = settings or InertialSettings()
        self.reason = "waiting for the IMU"
        self.counts = {"images": 0, "losses": 0, "gaps": 0}
        self.filter: InertialFilter | None = None
        self._info, self._count = info, corners
        self._imu, self._judge = ImuBuffer(), PictureJudge()
        self._tracker = CornerTracker(corners)
        self._queue: deque[_SeenImage] = deque()
        self._rest = _Rest()
        self._moving: deque[SeenCorners] = deque(maxlen=_MOST_MOVING)
        self._before_ns = self._view_ns = self._held_ns = self._since_ns = self._first_ns = 0
        self._last: InertialPose | None = None
        self._tries = 0
        self._period_s = 0.0

    @property
    def corners(self) -> FollowedCorners:
        """The corners in the last image."""
        return self._tracker.corners

    @property
    def lens_fault(self) -> str:
        """A warning if the images contradict the calibration; empty otherwise.

        With few images a second, a correct focal length is estimated too short, so nothing is said.
        """
        if self.filter is None or self._period_s > _SELDOM_S:
            return ""
        return self.filter.lens.fault(self._info, self.settings.camera.focal)

    @property
    def focal_length(self) -> str:
        """The estimated focal length, as text; empty before the start."""
        return "" if self.filter is None else self.filter.lens.words(self._info)

    def feel(self, stamp_ns: int, rates: Floats, force: Floats, mounting: Mounting) -> bool:
        """Take a measurement of the IMU in its axes; False if it is a duplicate or no number."""
        return self._imu.add(stamp_ns, rates, force, mounting)

    def see(self, stamp_ns: int, gray: Pixels, T_base_camera: Floats, turning: Floats) -> None:
        """Take an image (H, W), uint8; see `SeenCorners` for the rest."""
        self._queue.append(_SeenImage(stamp_ns, gray, T_base_camera, turning))

    def ready(self) -> Iterator[tuple[int, InertialPose | None]]:
        """Stamps and poses of the images that the IMU has reached; None before the start."""
        while self._queue:
            newest_ns = self._imu.newest_ns
            is_reached = newest_ns is not None and newest_ns >= self._queue[0].stamp_ns
            if not is_reached and len(self._queue) <= _MOST_WAITING:
                return
            image = self._queue.popleft()
            yield image.stamp_ns, self._take(image)

    def _take(self, image: _SeenImage) -> InertialPose | None:
        """The pose of an image."""
        self.counts["images"] += 1
        stamp_ns = image.stamp_ns
        self._first_ns = self._first_ns or stamp_ns
        if stamp_ns <= self._before_ns:
            return None
        fault = self._judge.fault(image.gray)
        if np.linalg.norm(image.turning) > _FASTEST_MOUNT:
            fault = "the camera's transform jumps"
        corners = self._tracker.follow(image.gray)
        seconds, self._before_ns = (stamp_ns - self._before_ns) / 1e9, stamp_ns
        if stamp_ns > self._first_ns:
            usual_s = min(seconds, _GAP_S)
            self._period_s += (usual_s - self._period_s) / min(self.counts["images"] - 1, _USUAL)
        if fault:
            self._tracker.refill()
            if self.filter is not None:
                return self._answer(stamp_ns, self.filter.propagate(stamp_ns), fault)
            self._begin(stamp_ns, self._rest.judge(self._imu, stamp_ns, image.gray, None))
            own = self.filter
            return self._answer(stamp_ns, own is None or own.propagate(stamp_ns), self.reason)
        few = self._usable(corners)
        rays, rolling = (one[few] for one in directions_by_rows(corners, self._info, seconds))
        ids = corners.ids[few]
        view = SeenCorners(stamp_ns, ids, rays, image.T_base_camera, image.turning, rolling)
        compared = None if self.filter is None else corners
        is_still = self._rest.judge(self._imu, stamp_ns, image.gray, compared)
        is_still &= self.filter is None or self._rest.seconds > _LEAST_STILL_S
        self._tracker.refill()
        if self.filter is None:
            self._begin(stamp_ns, is_still)
            own = self.filter
            if own is None and not is_still:
                return self._answer(stamp_ns, self._begin_moving(view), self.reason)
            if own is None or is_still:
                return self._answer(stamp_ns, True, self.reason)
            return self._answer(stamp_ns, own.see(*view), "")
        is_reached = self._go_on(self.filter, view, is_still)
        return self._answer(stamp_ns, is_reached, self._fault(self.filter, view, is_still))

    def _usable(self, corners: FollowedCorners) -> Indices:
        """Places of corners in a part of the image where a pixel is about the same direction.

        At the rim of a fisheye it is several times as much at z = 1, and behind it none.
        """
        every = np.arange(len(corners.ids))
        if self._info.distortion_model == "equidistant":
            every = every[rays_of(corners.pixels_uv, self._info).directions[:, 2] > _WIDEST]
        return every[: self._count]

    # the start

    def _begin(self, stamp_ns: int, is_still: bool) -> None:
        """Begin once the robot has rested: scale and gravity come from that.

        What begins with a rest may be shorter: robots are switched on at rest.
        """
        rest = self._rest
        from_ns, until_ns = max(rest.from_ns, self._since_ns), rest.until_ns
        self.reason = "at rest" if is_still else _MOVES
        if not is_still and rest.ended[0] == self._first_ns:
            from_ns, until_ns = rest.ended
        if until_ns - from_ns < (_REST_NS if is_still else _LEAST_REST_NS):
            return
        first = start_at_rest(self._imu, from_ns, until_ns, self.settings.imu)
        if first is not None:
            self._start(first, until_ns)

    def _start(self, first: FirstEstimate, rest_ns: int) -> None:
        """Begin at an estimate, where the last one ended, and rest until a time."""
        last = self._coasted(first.stamp_ns)
        if last is not None:
            first = _continued(first, last)
        self.filter = InertialFilter(self.settings, self._imu, *first)
        for stamp_ns in range(first.stamp_ns + _STEP_NS, rest_ns - _STEP_NS // 2, _STEP_NS):
            self.filter.rest(stamp_ns)
        if rest_ns > first.stamp_ns:
            self.filter.rest(rest_ns)
        self.reason = ""
        self._view_ns = self._held_ns = rest_ns

    def _begin_moving(self, view: SeenCorners) -> bool:
        """Begin once the last views show the velocity; False if the IMU has a gap then."""
        views = self._moving
        if views and view.stamp_ns - views[-1].stamp_ns < _PERIOD_NS:
            return True
        views.append(view)
        self._tries += 1
        if len(views) < _LEAST_MOVING or self._tries % _EVERY:
            return True
        first = start_in_motion(self._imu, views, self.settings)
        if first is None:
            return True
        self._start(first, first.stamp_ns)
        own, self._view_ns = self.filter, view.stamp_ns
        if own is None:
            return False
        own.doubt()  # with much to correct, what is trusted too much is lost for good
        is_reached = all(own.see(*one) for one in views)
        if own.contradicted or own.used < _LEAST:
            self.filter, self.reason = None, _MOVES
        else:
            views.clear()
        return is_reached

    # the motion

    def _go_on(self, own: InertialFilter, view: SeenCorners, is_still: bool) -> bool:
        """Apply an image; False if the IMU has a gap."""
        if is_still:
            self._held_ns = view.stamp_ns
            return own.rest(view.stamp_ns)
        if view.stamp_ns - self._view_ns < _PERIOD_NS:
            return own.propagate(view.stamp_ns)
        self._view_ns = view.stamp_ns
        return own.see(*view)

    def _fault(self, own: InertialFilter, view: SeenCorners, is_still: bool) -> str:
        """The reason why corners do not hold the estimate; it is loosened after a while."""
        if own.used >= _LEAST or is_still or view.stamp_ns != self._view_ns:
            self._held_ns = view.stamp_ns if own.used >= _LEAST else self._held_ns
        if view.stamp_ns - self._held_ns < _LOST_NS:
            return ""
        if len(view.ids) < 2 * _LEAST:
            return "too few corners"
        if own.contradicted and view.stamp_ns - self._held_ns > _WRONG_NS:
            own.loosen()
            self._held_ns = view.stamp_ns - _LOST_NS
            self.counts["losses"] += 1
        return "the corners contradict the IMU"

    def _answer(self, stamp_ns: int, is_reached: bool, reason: str) -> InertialPose | None:
        self.reason = reason
        if self.filter is None:
            return self._coasted(stamp_ns) if self._last is not None else None
        if not is_reached:
            self.reason = "the IMU has a gap"
            self.counts["gaps"] += 1
            self._last = self._coasted(stamp_ns)
            self.filter, self._since_ns = None, stamp_ns
            return self._last
        self._last = self._pose(self.filter, stamp_ns, bool(reason))
        return self._last

    def _pose(self, own: InertialFilter, stamp_ns: int, is_lost: bool) -> InertialPose:
        robot, P = own.state.robot, own.state.P
        gyro, _ = self._imu.densities(stamp_ns)
        of_twist = np.zeros((6, 6))
        of_twist[:3, :3] = robot.R.T @ P[MOTION, MOTION] @ robot.R
        of_twist[3:, 3:] = P[RATE_BIAS, RATE_BIAS] + np.eye(3) * (100 * gyro**2 + 1e-6)
        linear, angular = robot.R.T @ robot.v, robot.R.T @ robot.rates
        return InertialPose(
            stamp_ns, robot.R, robot.p, linear, angular, P[POSE, POSE].copy(), of_twist, is_lost
        )

    def _coasted(self, stamp_ns: int) -> InertialPose | None:
        """The last pose, with what may have happened since."""
        last = self._last
        if last is None:
            return None
        seconds = max(stamp_ns - last.stamp_ns, 0) / 1e9
        way = (float(np.linalg.norm(last.linear)) + _LOST_SPEED) * seconds
        own = np.diag(np.repeat([way, min(_LOST_TURN * seconds, np.pi)], 3) ** 2)
        change = se3.about_origin(last.p)
        covariance = last.covariance + change @ own @ change.T
        unknown = np.eye(6) * 1e6
        return last._replace(
            stamp_ns=stamp_ns, covariance=covariance, of_twist=unknown, is_lost=True
        )


def _continued(first: FirstEstimate, last: InertialPose) -> FirstEstimate:
    """A first estimate, placed and turned to where an earlier one ended."""
    yaw = np.arctan2(last.R[1, 0], last.R[0, 0])
    Y = se3.exp(np.array([0, 0, 0, 0, 0, yaw]))[0]
    robot = replace(first.robot, R=Y @ first.robot.R, p=last.p, v=Y @ first.robot.v)
    J = np.eye(15)
    J[POSE, POSE], J[MOTION, MOTION] = se3.adjoint(Y, last.p), Y
    P = J @ first.covariance @ J.T
    there = se3.about_itself(last.p)
    of_place = there @ last.covariance @ there.T
    of_place[3:5], of_place[:, 3:5] = 0, 0  # the tilt is known anew
    back = se3.about_origin(last.p)
    P[POSE, POSE] += back @ of_place @ back.T
    return FirstEstimate(first.stamp_ns, robot, P)


class _Rest:
    """Judges if a robot rests: a quiet IMU, and images that stay.

    Attributes:
        from_ns, until_ns: first and last image of this rest, which has begun if they differ.
        ended: those of the last one.
    """

    def __init__(self) -> None:
        self.from_ns = self.until_ns = 0
        self.ended = 0, 0
        self._small: Pixels | None = None
        self._moved, self._force = np.zeros(3), np.zeros(3)

    @property
    def seconds(self) -> float:
        """Duration of this rest, seconds."""
        return (self.until_ns - self.from_ns) / 1e9

    def judge(
        self,
        imu: ImuBuffer,
        stamp_ns: int,
        gray: Pixels,
        corners: FollowedCorners | None,
    ) -> bool:
        """True if the robot rests since the image before.

        Without corners, the whole image is compared.
        """
        small = np.asarray(cv2.resize(gray, None, fx=_THIN, fy=_THIN, interpolation=cv2.INTER_AREA))
        is_known = self._small is not None and self._small.shape == small.shape
        if is_known and self._is_quiet(imu, stamp_ns) and self._stays(small, corners):
            self.until_ns = stamp_ns
            return True
        if self.until_ns > self.from_ns:
            self.ended = self.from_ns, self.until_ns
        self.from_ns = self.until_ns = stamp_ns
        self._small, self._moved = small, np.zeros(3)
        return False

    def _is_quiet(self, imu: ImuBuffer, stamp_ns: int) -> bool:
        parts = imu.between(self.until_ns, stamp_ns)
        if not parts:
            return False
        rates, forces = np.array([one.rates for one in parts]), np.array([o.force for o in parts])
        force = forces.mean(axis=0)
        if self.until_ns == self.from_ns:
            self._force = force
        return bool(
            forces.std(axis=0).max() < _QUIET_FORCE
            and np.abs(force - self._force).max() < _SAME_FORCE
            and rates.std(axis=0).max() < _QUIET_RATES
            and np.abs(rates.mean(axis=0)).max() < _SLOW
        )

    def _stays(self, small: Pixels, corners: FollowedCorners | None) -> bool:
        """True if the corners, or else the image, stay as they were when the rest began."""
        if corners is None and self._small is not None:
            return float(cv2.absdiff(small, self._small).mean()) < _STILL_LEVELS
        if corners is None or len(corners.ids) < _LEAST:
            return False
        steps = corners.pixels_uv - corners.before_uv
        away = corners.before_uv - np.mean(corners.before_uv, axis=0)
        grows = np.median((steps * away).sum(axis=1) / np.hypot(*away.T).clip(1))
        self._moved = self._moved + np.append(np.median(steps, axis=0), grows)
        far = float(np.quantile(np.linalg.norm(steps, axis=1), 0.8))
        return max(far, float(np.linalg.norm(self._moved))) < _STILL_PX

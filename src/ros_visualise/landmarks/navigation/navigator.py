"""The navigator: propagates the robot's pose by its sensors, and corrects it by landmarks.

Images are processed later than the odometry of their time. So the state stays at the last image,
and the present estimate is that state propagated since. A new image is applied at its own time, and
nothing has to be undone.
"""

from __future__ import annotations

import logging
from bisect import insort
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.geometry.rigid import IDENTITY, Pose, to_matrix
from ros_visualise.geometry.se3 import about_itself, about_origin, inverse
from ros_visualise.landmarks.navigation.camera_view import CameraView
from ros_visualise.landmarks.navigation.imu import ImuMounting
from ros_visualise.landmarks.navigation.landmark import KnownLandmark
from ros_visualise.landmarks.navigation.landmark_map import ImageOutcome, LandmarkMap, MapMode
from ros_visualise.landmarks.navigation.motion import OdometryStep, begin, up_of
from ros_visualise.landmarks.navigation.odometer import OdometryBuffer
from ros_visualise.landmarks.navigation.pose_search import PoseSearch, SearchPrior
from ros_visualise.landmarks.navigation.robot import POSE, SCALES
from ros_visualise.landmarks.navigation.sensor_buffer import SensorBuffer
from ros_visualise.landmarks.navigation.settings import NavigatorSettings
from ros_visualise.landmarks.navigation.trail import PropagationTrail

log = logging.getLogger(__name__)

_BACK_NS = 1_000_000_000  # stamps going back more than this mean that time was reset
_MOST_WAITING = 100  # images
_LOST_AFTER = 3  # images in a row that contradict the estimate


@dataclass(frozen=True, eq=False)
class RobotEstimate:
    """Pose of the robot at the time of an odometry message.

    ``covariance`` (6, 6) is of the position and of rotations about the robot, in the map;
    ``T_map_odom`` (4, 4) is the correction of the odometry. If ``is_located`` is false, they are
    the last known ones.
    """

    stamp_ns: int
    T_map_base: Floats
    T_map_odom: Floats
    covariance: Floats
    is_located: bool


class Navigator:
    """Localizes the robot in a map of landmarks.

    Attributes:
        state, at_ns: at the last image, or at an older odometry message if no images come.
        landmark_map: the landmarks.
        outcome: results of the last image.
        is_located: True if the robot is localized.
        reason: why it is not; empty while it is.
        counts: images by outcome.
        has_news: True after an image was applied, until its publisher resets it.

    Args:
        known: the landmarks of a map, by name, each with its own error alone.
        start: T_map_odom at the start of a new map.
        common: (6, 6) covariance of the twist of the whole map.
    """

    def __init__(
        self,
        settings: NavigatorSettings,
        known: Mapping[str, KnownLandmark] | None = None,
        start: Pose = IDENTITY,
        common: Floats | None = None,
    ) -> None:
        self.settings, self.common = settings, np.zeros((6, 6)) if common is None else common
        self._known, self._start = dict(known or {}), start
        self.counts = {"images": 0, "late": 0, "frozen": 0, "losses": 0, "recovered": 0}
        self.reset()

    def reset(self) -> None:
        """Start again after a time jump."""
        self.state = self.settings.unknown()
        self.landmark_map = LandmarkMap(self.settings.rules, self._known)
        self.outcome = ImageOutcome()
        self.is_located = False
        self.reason = "not localized: needs one map tag in three images"
        self.sensors = SensorBuffer(self.settings.noise)
        self._search = PoseSearch()
        self._trail = PropagationTrail(self.sensors, self.state)
        self._waiting: list[tuple[int, int, CameraView]] = []
        self._count = self._contradicted = self.at_ns = 0
        self._has_pose = self.has_news = False
        self._last_print: bytes = b""

    @property
    def found_by(self) -> set[str]:
        """Tags that support the likeliest pose so far, while not localized."""
        return self._search.names

    def configure(self, settings: NavigatorSettings) -> None:
        """Change the settings."""
        self.settings, self.sensors.noise = settings, settings.noise

    def odometry(self, stamp_ns: int, pose: Pose) -> RobotEstimate | None:
        """Process an odometry pose, T_odom_base; None while the robot's pose is unknown."""
        newest_ns = self.sensors.odometer.newest_ns
        if newest_ns is not None and stamp_ns <= newest_ns:
            if stamp_ns < newest_ns - _BACK_NS:
                self.reset()
            else:
                return None
        step = self.sensors.odometer.add(stamp_ns, pose)
        if step is None:
            self._begin(stamp_ns, pose)
        elif self._is_jump(step):
            self._jump(stamp_ns, pose)
        else:
            self._go_on(step)
        self._work()
        self._keep_up(stamp_ns)
        return self._now(stamp_ns) if self._has_pose else None

    def imu(self, stamp_ns: int, rates: Floats, force: Floats, mounting: ImuMounting) -> None:
        """Process an angular velocity (3,), rad/s, and specific force (3,), m/s^2, in the IMU's
        axes.
        """
        self.sensors.imu.add(stamp_ns, rates, force, mounting)

    def fix(self, stamp_ns: int, geodetic: Floats, covariance: Floats, arm: Floats) -> None:
        """Process a GPS fix; see `ros_visualise.landmarks.navigation.gps.GpsBuffer.add`."""
        is_new = self.sensors.gps.add(stamp_ns, geodetic, covariance, arm)
        if is_new and self.is_located and self.sensors.gps.place(self.state, self._trail.newest):
            self._retrace()

    def see(self, view: CameraView) -> bool:
        """Queue an image; True if it was applied already, else its odometry is still missing."""
        self._count += 1
        insort(self._waiting, (view.stamp_ns, self._count, view))
        if len(self._waiting) > _MOST_WAITING:  # the odometry has stopped
            self.counts["late"] += 1
            self._waiting.pop(0)
        return self._work()

    def _begin(self, stamp_ns: int, pose: Pose) -> None:
        """Start at the odometry's frame: known when a map is built, except its tilt."""
        self.at_ns = stamp_ns
        if self.settings.rules.mode is MapMode.BUILD:
            T = to_matrix(self._start) @ to_matrix(pose)
            tilt = np.diag([0, 0, 0, 1, 1, 0]) * self.settings.level_rad**2
            change = about_origin(to_matrix(self._start)[:3, 3])
            self._stand(T[:3, :3], T[:3, 3], change @ tilt @ change.T)
            self._locate()
        self._trail.restart(self.state, stamp_ns)

    def _stand(self, R: Floats, p: Floats, covariance: Floats) -> None:
        begin(self.state, R, p, covariance, self.settings.noise.odometry)

    def _locate(self) -> None:
        self.is_located = self._has_pose = True
        self.reason = ""
        self._contradicted = 0
        self._search.clear()

    def _is_jump(self, step: OdometryStep) -> bool:
        """True if the step is faster than the robot can be, unless an IMU measured it."""
        is_fast = np.hypot(*step.motion[:2]) > self.settings.fastest * max(step.seconds, 0.02)
        return bool(is_fast) and not (self.is_located and self.sensors.has_imu(step))

    def _jump(self, stamp_ns: int, pose: Pose) -> None:
        """Restart the odometry elsewhere: the robot itself stays, as far as is known."""
        self._work()
        robot = self._trail.newest.robot
        self.state.robot = replace(self.state.robot, R=robot.R, p=robot.p)
        self.sensors.odometer = OdometryBuffer()
        self.sensors.odometer.add(stamp_ns, pose)
        self.at_ns = stamp_ns
        self._trail.restart(self.state, stamp_ns)
        self._search.clear()
        if self._has_pose:
            self._lose("the odometry jumped")

    def _lose(self, why: str) -> None:
        self.is_located = False
        self.reason = f"lost: {why}; two different map tags are needed to relocalize"
        self.counts["losses"] += 1
        log.warning("%s", self.reason)

    def _go_on(self, step: OdometryStep) -> None:
        """Propagate by the newest odometry."""
        was_refused = self.sensors.is_imu_rejected
        self._trail.add(step, self.is_located)
        if self.sensors.is_imu_rejected and not was_refused:
            log.warning("the IMU contradicts the odometry: ignoring it; check its tf frame")

    def _work(self) -> bool:
        """Apply the images whose odometry has come; True if there were any."""
        newest_ns = self.sensors.odometer.newest_ns
        worked = False
        while newest_ns is not None and self._waiting and self._waiting[0][0] <= newest_ns:
            view = self._waiting.pop(0)[2]
            worked = self._put_in(view) or worked
        if worked:
            self._retrace()
        return worked

    def _put_in(self, view: CameraView) -> bool:
        self.counts["images"] += 1
        is_same = bool(view.sights) and view.print == self._last_print
        if view.stamp_ns < self.at_ns or is_same:
            self.counts["frozen" if is_same else "late"] += 1
            if is_same:
                self.outcome, self.has_news = (
                    ImageOutcome.same(one.name for one in view.sights),
                    True,
                )
            return is_same
        self._last_print = view.print
        self._advance(view.stamp_ns)
        self.has_news = True
        if self.is_located:
            self.state, self.outcome = self.landmark_map.take(self.state, view)
            self._doubt(view)
        else:
            self.outcome = ImageOutcome(rejected=dict(view.skipped))
            self._search.look(view, self.landmark_map.map_of(self.state), self._prior(view))
            self._recover(1 if not self._has_pose else 2)
            if self.reason and view.sights:
                self.outcome.advice["the robot"] = self.reason
        self._trail.restart(self.state, self.at_ns)
        return True

    def _doubt(self, view: CameraView) -> None:
        """Search for another pose while all map landmarks contradict this one."""
        if self.outcome.used:
            self._contradicted = 0
            self._search.clear()
            return
        known = self.landmark_map.map_of(self.state)
        if any(sight.name in known for sight in view.sights):
            self._contradicted += 1
            self._search.look(view, known, self._prior(view))
            if self._contradicted >= _LOST_AFTER and self._search.found(min(2, len(known))):
                self._lose("all landmarks contradict the estimated pose")
                self._recover(2)

    def _recover(self, least_names: int) -> None:
        """Continue at the pose that the search has found."""
        known = self.landmark_map.map_of(self.state)
        found = self._search.found(min(least_names, len(known)))
        if found is None:
            return
        if self._has_pose:
            self.counts["recovered"] += 1
            log.warning("relocalized by %s", ", ".join(found.keys))
        self._stand(found.R, found.p, found.covariance[POSE, POSE])
        self.state.robot = replace(self.state.robot, scales=found.robot.scales)
        self.state.covariance[SCALES, SCALES] = found.covariance[SCALES, SCALES]
        self.outcome = ImageOutcome(used=[])
        self._locate()

    def _prior(self, view: CameraView) -> SearchPrior:
        """Prior knowledge about any pose of the robot at an image."""
        up = up_of(self.sensors.odometer.at(view.stamp_ns))
        return SearchPrior(up, self.settings.level_rad, self.settings.noise.odometry)

    def _advance(self, stamp_ns: int) -> None:
        """Propagate the state to a time."""
        if stamp_ns == self.at_ns:
            return
        now = self._trail.at(stamp_ns, self.is_located)
        self.state = now.applied_to(self.state, self.landmark_map.is_frozen)
        steps = self.sensors.odometer.steps(self.at_ns, stamp_ns) if self._search.places else []
        self._search.predict(steps, self.settings.noise.odometry)
        self.at_ns = stamp_ns

    def _keep_up(self, newest_ns: int) -> None:
        """Advance past the oldest image that may still come; rarely, as that takes time."""
        delay_ns = round(self.settings.delay_s * 1e9)
        if self.at_ns < newest_ns - 2 * delay_ns:
            self._advance(newest_ns - delay_ns)
            self._retrace()
        self.sensors.forget(self.at_ns)

    def _retrace(self) -> None:
        """Propagate the state again by what was measured since."""
        newest_ns = self.sensors.odometer.newest_ns
        self._trail.restart(self.state, self.at_ns)
        if newest_ns is not None:
            self._trail.catch_up(newest_ns, self.is_located)

    def _now(self, stamp_ns: int) -> RobotEstimate:
        now = self._trail.newest
        robot = now.robot
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = robot.R, robot.p
        change = about_itself(robot.p)
        covariance = change @ (now.P[POSE, POSE] + self.common) @ change.T
        T_map_odom = T @ inverse(to_matrix(self.sensors.odometer.newest))
        return RobotEstimate(stamp_ns, T, T_map_odom, covariance, self.is_located)

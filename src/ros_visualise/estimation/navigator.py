"""The navigator: takes measurements in any order, and tells where the robot is."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.belief import Belief, Note, lost
from ros_visualise.estimation.camera_view import CameraView
from ros_visualise.estimation.filter import Filter, OdometryEvent, StatedPose
from ros_visualise.estimation.imu import Mounting
from ros_visualise.estimation.initial_pose import InitialPose
from ros_visualise.estimation.landmark import KnownLandmark
from ros_visualise.estimation.landmark_map import ImageOutcome, LandmarkMap
from ros_visualise.estimation.odometry import OdometryPose
from ros_visualise.estimation.pose_search import apart
from ros_visualise.estimation.robot import POSE
from ros_visualise.estimation.sensors import Reading
from ros_visualise.estimation.settings import NavigatorSettings
from ros_visualise.estimation.stamps import StampGuard, Verdict
from ros_visualise.estimation.state import State
from ros_visualise.estimation.window import EventWindow
from ros_visualise.geometry.rigid import Pose, to_matrix
from ros_visualise.geometry.se3 import about_itself, inverse

log = logging.getLogger(__name__)


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

    Args:
        settings: see `NavigatorSettings`.
        known: the landmarks of a map, by name, each with its own error alone.
        start: T_map_odom at the start of a new map; None if unknown: the map begins there.
        common: (6, 6) covariance of the twist of the whole map.
    """

    def __init__(
        self,
        settings: NavigatorSettings,
        known: Mapping[str, KnownLandmark] | None = None,
        start: Pose | None = None,
        common: Floats | None = None,
    ) -> None:
        self.common = np.zeros((6, 6)) if common is None else common
        self._start = start
        self._stamps = StampGuard()
        self._said: set[Note] = set()
        self._dropped: Counter[str] = Counter()
        self._begin(settings, LandmarkMap(settings.rules, known or {}))

    def _begin(self, settings: NavigatorSettings, landmark_map: LandmarkMap) -> None:
        filter = Filter(settings, self._start)
        self._window = EventWindow(filter, filter.begin(landmark_map))

    def reset(self) -> None:
        """Start again after a time jump: the robot is lost, and the map built so far is kept."""
        before = self.belief
        settings = self.settings
        self._dropped += self._window.dropped
        self._begin(settings, before.map.copy())
        if before.map.used:
            reason = lost("time jumped", before.map.tags)
            log.warning("keeping the map of %d landmarks; %s", len(before.map.used), reason)
            state, first = before.state.whole(), self.belief
            unknown = first.state
            first.state = state.with_robot_of(unknown)
            first.has_pose = True
            first.reason = reason
        else:
            self.belief.map.landmarks.clear()
        self._stamps = StampGuard()

    @property
    def settings(self) -> NavigatorSettings:
        """The present settings."""
        return self._window.filter.settings

    @property
    def belief(self) -> Belief:
        """The belief after all that could be applied; not to be changed."""
        return self._window.newest

    @property
    def state(self) -> State:
        """The newest state, all landmarks active."""
        return self.belief.state.whole()

    @property
    def map(self) -> LandmarkMap:
        """The landmarks."""
        return self.belief.map

    @property
    def outcome(self) -> ImageOutcome:
        """Results of the last image."""
        return self.belief.outcome

    @property
    def is_located(self) -> bool:
        """True if the robot's pose is known in the map."""
        return self.belief.is_located and not self.belief.reason

    @property
    def has_imu(self) -> bool:
        """True if an IMU has measured."""
        return self._window.filter.imu.newest_ns is not None

    @property
    def counts(self) -> dict[str, int]:
        """Numbers of events, and of measurements dropped, by reason."""
        basic = dict.fromkeys(("images", "frozen", "losses", "recovered"), 0)
        return {**basic, **self.belief.counts, **self.dropped}

    @property
    def dropped(self) -> Counter[str]:
        """Numbers of measurements dropped, by sensor and reason."""
        return self._dropped + self._window.dropped

    @property
    def late_s(self) -> dict[str, float]:
        """Age of the last measurement dropped as too old, by sensor."""
        return self._window.late_s

    def news(self) -> list[str]:
        """Warnings for the user, each once."""
        new = [note for note in self.belief.notes if note not in self._said]
        self._said.update(new)
        return [note.text for note in new]

    def configure(self, settings: NavigatorSettings) -> None:
        """Change the settings."""
        self._window.configure(settings)

    def odometry(
        self, stamp_ns: int, pose: Pose, variances: Floats | None = None
    ) -> RobotEstimate | None:
        """Process an odometry pose, T_odom_base; None while the robot's pose is unknown.

        Args:
            variances: (4,) of its velocity and yaw rate, see `OdometryPose`.
        """
        if not self._is_present("odometry", stamp_ns):
            return None
        window, filter = self._window, self._window.filter
        odometry_pose = OdometryPose(pose) if variances is None else OdometryPose(pose, variances)
        if not filter.odometer.add(stamp_ns, odometry_pose):
            self._dropped["odometry: repeated stamp"] += 1
            return None
        window.add(OdometryEvent(stamp_ns))
        window.run()
        belief = window.at(stamp_ns)
        if belief is None or not belief.has_pose:
            return None
        return self._estimate(belief, pose)

    def place(self, pose: InitialPose) -> bool:
        """Put the robot where the user states, at the newest odometry; there is one.

        Returns:
            False if that is too old, as the odometry has stopped.
        """
        newest_ns = self._window.filter.odometer.newest_ns
        assert newest_ns is not None
        is_in_time = self._window.add(StatedPose(newest_ns, pose))
        self._window.run()
        return is_in_time

    def imu(self, stamp_ns: int, rates: Floats, force: Floats, mounting: Mounting) -> None:
        """Process an angular velocity (3,), rad/s, and specific force (3,), m/s^2, in the IMU's
        axes.
        """
        if not self._is_present("imu", stamp_ns) or self._window.is_past("imu", stamp_ns):
            return
        if not self._window.filter.imu.add(stamp_ns, rates, force, mounting):
            self._dropped["imu: repeated stamp, or no number"] += 1
            return
        self._window.redo(self._window.filter.imu.before(stamp_ns))
        self._window.run()

    def read(self, reading: Reading) -> None:
        """Process a reading of another sensor."""
        if self._is_present(reading.sensor, reading.stamp_ns):
            self._window.add(reading)
            self._window.run()

    def see(self, view: CameraView) -> bool:
        """Process an image; True if it was applied already, else its odometry is still missing."""
        if not self._is_present("image", view.stamp_ns):
            return False
        before = self.belief.counts["images"]
        is_in_time = self._window.add(view)
        self._window.run()
        return is_in_time and self.belief.counts["images"] > before

    def _is_present(self, sensor: str, stamp_ns: int) -> bool:
        verdict = self._stamps.judge(sensor, stamp_ns)
        if verdict is Verdict.WILD:
            self._dropped[f"{sensor}: stamp far from all others"] += 1
            log.warning(
                "%s: ignoring the stamp %.3f s, which is far from all others",
                sensor,
                stamp_ns / 1e9,
            )
        if verdict is Verdict.RESET:
            self.reset()
            self._stamps.judge(sensor, stamp_ns)
        return verdict is not Verdict.WILD

    def _estimate(self, belief: Belief, odometry: Pose) -> RobotEstimate:
        robot = belief.state.robot
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = robot.R, robot.p
        change = about_itself(robot.p)
        covariance = change @ (belief.state.P[POSE, POSE] + self.common) @ change.T
        offs = [belief.contradiction]
        if belief.rival is not None:
            offs.append(apart(belief.rival, belief.state))
        covariance += sum(np.multiply.outer(off, off) for off in offs)
        T_map_odom = T @ inverse(to_matrix(odometry))
        is_located = belief.is_located and not belief.reason
        return RobotEstimate(belief.now_ns, T, T_map_odom, covariance, is_located)

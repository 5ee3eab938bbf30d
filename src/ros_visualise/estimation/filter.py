"""The filter: a belief and the next event give the next belief.

Between events the robot is propagated by the IMU if it is trusted, and the odometry is compared
with it (`ros_visualise.estimation.rivalry`); else by the odometry.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation import findings, plates, rivalry
from ros_visualise.estimation.belief import Belief
from ros_visualise.estimation.camera_view import CameraView, Sighting
from ros_visualise.estimation.imu import ImuBuffer, ImuIntervals, propagate_by_imu
from ros_visualise.estimation.initial_pose import InitialPose
from ros_visualise.estimation.landmark_map import ImageOutcome, LandmarkMap, MapMode
from ros_visualise.estimation.measuring import camera_of, clock_of, turn_of
from ros_visualise.estimation.odometry import (
    GAP_NS,
    OdometryBuffer,
    clone_pose,
    is_speed_known,
    place_robot,
    propagate_by_odometry,
    up_of,
)
from ros_visualise.estimation.pose_search import SearchPrior
from ros_visualise.estimation.robot import core
from ros_visualise.estimation.sensors import SENSORS, Reading
from ros_visualise.estimation.settings import NavigatorSettings
from ros_visualise.estimation.steadiness import words
from ros_visualise.estimation.updating import together
from ros_visualise.geometry import se3
from ros_visualise.geometry.rigid import IDENTITY, Pose, to_matrix

_LOST_AFTER = 3  # images in a row that contradict the estimate
_PATIENCE_NS = 5_000_000_000  # after which one map tag alone is believed again
_SEARCHING = "not localized: needs one map tag in three images"


class OdometryEvent(NamedTuple):
    """An odometry message, whose pose is in the buffer."""

    stamp_ns: int


class StatedPose(NamedTuple):
    """A pose of the robot that the user states, at the time of an odometry message."""

    stamp_ns: int
    pose: InitialPose


Event = OdometryEvent | CameraView | Reading | StatedPose


class Filter:
    """Turns events into beliefs.

    Attributes:
        settings: see `NavigatorSettings`.
        odometer, imu: the last seconds of both.
        start: T_map_odom at the start of a new map; None if unknown.
    """

    def __init__(self, settings: NavigatorSettings, start: Pose | None) -> None:
        self.settings, self.start = settings, start
        self.odometer, self.imu = OdometryBuffer(), ImuBuffer()

    def begin(self, landmark_map: LandmarkMap) -> Belief:
        """The belief before any event."""
        return Belief(self.settings.unknown(), landmark_map, _SEARCHING, self.start is not None)

    def reaches(self, belief: Belief, stamp_ns: int) -> bool:
        """True if the robot can be propagated to a time by what was measured so far."""
        newest_ns = self.odometer.newest_ns
        if newest_ns is None or stamp_ns <= newest_ns:
            return newest_ns is not None
        if belief.stamp_ns is None or stamp_ns <= belief.stamp_ns:
            return belief.stamp_ns is not None
        imu_ns = self.imu.newest_ns
        is_silent = imu_ns is not None and imu_ns > newest_ns + GAP_NS and stamp_ns <= imu_ns
        return is_silent and self._intervals(belief, stamp_ns) is not None

    def after(self, belief: Belief, event: Event) -> Belief:
        """The belief after an event.

        Raises:
            ImuIsWrong: see `rivalry`.
        """
        last, belief = belief, belief.copy()
        if belief.stamp_ns is None:
            if isinstance(event, OdometryEvent):
                self._start(belief, event.stamp_ns)
            else:
                belief.counts["too early"] += 1
            return belief
        belief.after_odometry = last.after_odometry or last
        self._advance(belief, event.stamp_ns)
        if isinstance(event, OdometryEvent):
            self._compare(belief, event.stamp_ns)
        elif isinstance(event, Reading):
            self._read(belief, event)
        elif isinstance(event, StatedPose):
            self._place(belief, event)
        else:
            self._see(belief, event)
        return belief

    # odometry and IMU

    def _start(self, belief: Belief, stamp_ns: int) -> None:
        """Begin at the odometry's frame: known when a map is built, except its tilt."""
        belief.stamp_ns = stamp_ns
        belief.is_by_imu = True
        has_map = bool(belief.map.used)
        if belief.map.rules.mode is MapMode.BUILD and not has_map:
            begun = to_matrix(self.start or IDENTITY)
            T = begun @ to_matrix(self.odometer.at(stamp_ns))
            tilt = np.diag([0, 0, 0, 1, 1, 0]) * self.settings.level_rad**2
            change = se3.about_origin(begun[:3, 3])
            covariance = change @ tilt @ change.T
            belief.state = belief.state.copy()
            place_robot(belief.state, T[:3, :3], T[:3, 3], covariance, self.settings.odometry)
            belief.locate()

    def _intervals(self, belief: Belief, to_ns: int) -> ImuIntervals | None:
        """The IMU's intervals from a belief on; None if it cannot propagate the robot."""
        is_usable = self.settings.has_imu and belief.is_located and is_speed_known(belief.state)
        if not is_usable or belief.now_ns < belief.imu.ignored_until_ns:
            return None
        return self.imu.between(belief.now_ns, to_ns)

    def _advance(self, belief: Belief, to_ns: int) -> None:
        """Propagate a belief to a time."""
        from_ns = belief.now_ns
        if to_ns <= from_ns:
            return
        parts = self._intervals(belief, to_ns)
        belief.state = belief.state.copy()
        if parts is not None:
            rates, force = self.imu.densities(to_ns)
            declared = self.settings.imu
            noise = replace(
                declared, gyro=max(declared.gyro, rates), accel=max(declared.accel, force)
            )
            propagate_by_imu(belief.state, parts, noise)
        else:
            belief.is_by_imu = False
        steps = self.odometer.steps(from_ns, to_ns) if self.odometer.covers(to_ns) else []
        steps = [step for step in steps if step.speed <= self.settings.fastest]
        if parts is None:
            for step in steps:
                propagate_by_odometry(belief.state, step, self.settings.odometry)
            rivalry.grow(belief, to_ns)
        if belief.rival is not None:
            belief.rival = belief.rival.copy()
            for step in steps:  # that the odometry is right is what is tested
                right = step._replace(stalled=0.0)
                propagate_by_odometry(belief.rival, right, self.settings.odometry)
        if belief.search.places:
            belief.search = belief.search.copy()
            belief.search.predict(steps, self.settings.odometry)
        belief.stamp_ns = to_ns

    def _compare(self, belief: Belief, stamp_ns: int) -> None:
        """Compare the motion since the last odometry message with that of the odometry."""
        before_ns = self.odometer.before(stamp_ns)
        if before_ns is not None:
            step = self.odometer.step(before_ns, stamp_ns)
            has_jumped = step.speed > self.settings.fastest
            if belief.is_by_imu:
                rivalry.compare(belief, step, self.settings.odometry, has_jumped)
            elif has_jumped and belief.has_pose and belief.is_located:
                belief.search = belief.search.copy()
                belief.search.clear()
                belief.lose("the odometry jumped")
        if self.imu.newest_ns is not None:
            belief.state = belief.state.copy()
            clone_pose(belief.state)
        belief.is_by_imu = True
        belief.after_odometry = None

    def _place(self, belief: Belief, event: StatedPose) -> None:
        """Put the robot where the user states."""
        settings, odometry = self.settings, self.odometer.at(event.stamp_ns)
        belief.state = event.pose.placed(
            belief.state, odometry, settings.level_rad, settings.odometry
        )
        belief.is_by_imu = False  # its previous pose is none of odometry's
        belief.counts["initial poses"] += 1
        belief.locate()

    # other sensors, and images

    def _read(self, belief: Belief, reading: Reading) -> None:
        sensor = SENSORS.find(reading.sensor)
        if not belief.is_located or (sensor.needs_imu and not belief.is_by_imu):
            belief.counts[f"{reading.sensor} unused"] += 1
            return
        self._age(belief)
        params = self.settings.sensor(reading.sensor)
        if not sensor.is_of_another(belief, reading, params):
            rivalry.judge_by_sensor(belief, reading, sensor, params)
        sensor.apply(belief, reading, params)

    def _age(self, belief: Belief) -> None:
        """Let the errors of sensors change over the time since they did last."""
        last_ns = belief.memory.get("aged")
        belief.remember("aged", belief.now_ns)
        if last_ns is not None and belief.now_ns > last_ns:
            seconds, levels = (belief.now_ns - last_ns) / 1e9, [one.level for one in belief.cameras]
            keep, noise = self.settings.aging(seconds, levels)
            belief.state = belief.state.copy()
            belief.state.age(keep, noise)
            robot = belief.state.robot
            belief.state.robot = replace(robot, own=robot.own * keep[core() - len(robot.own) :])

    def _see(self, belief: Belief, view: CameraView) -> None:
        """Apply an image."""
        belief.counts["images"] += 1
        if view.sights and view.print == belief.last_print:
            belief.counts["frozen"] += 1
            belief.outcome = ImageOutcome.same(one.name for one in view.sights)
            return
        belief.last_print = view.print
        self._age(belief)
        belief.map, belief.search = belief.map.copy(), belief.search.copy()
        belief.map.rules = self.settings.rules
        if belief.is_located:
            if belief.rival is not None:
                rivalry.judge_by_tags(belief, view)
            self._check_steadiness(belief, view)
            belief.state, belief.outcome = belief.map.take(belief.state, view)
            if belief.outcome.used:
                findings.name_clock(belief, view)
            findings.name_sizes(belief)
            plates.note_moving(belief, view)
            self._verify(belief, view)
            return
        belief.outcome = ImageOutcome(rejected=dict(view.skipped))
        findings.name_missing_tags(belief, bool(self._search(belief, view)))
        self._recover(belief, 2 if belief.has_pose else 1)
        if belief.reason and view.sights:
            belief.outcome.advice["the robot"] = belief.reason

    def _check_steadiness(self, belief: Belief, view: CameraView) -> None:
        """Give the camera's attitude more room once images have shown that it needs it."""
        tags = belief.map.usable(view, ImageOutcome())
        belief.state = belief.map.enter(belief.state, tags)
        pairs = belief.map.decided(tags)
        before, errors = belief.cameras[view.camera], self.settings.camera
        if not pairs or not errors.turn_rad or before.is_final:
            return
        next_rad, turn = errors.at_level(before.next).turn_rad, turn_of(view.camera)
        after = before.after(*together(view, pairs, belief.state, turn, next_rad**2))
        cameras = [*belief.cameras]
        cameras[view.camera] = after
        belief.cameras = tuple(cameras)
        if after.level > before.level:
            now = errors.at_level(after.level)
            believed_rad = errors.at_level(before.level).turn_rad
            belief.state = belief.state.with_prior(turn, believed_rad**2, now.turn_rad**2)
            belief.state.inflate(turn, np.eye(3) * now.turn_rad**2)
            clock = clock_of(view.camera)  # its offset explained that unsteadiness so far
            belief.state.forget(clock)
            belief.state.inflate(clock, np.eye(1) * errors.clock_s**2)
            belief.note(
                f"camera {view.camera + 1} is less steady than camera_turn says; "
                + words(now.turn_rad, now.turn_s)
            )

    def _search(self, belief: Belief, view: CameraView) -> dict[str, str]:
        """Look for other poses; names and keys of the map's tags in view."""
        tags = belief.map.usable(view, belief.outcome)
        belief.state = belief.map.enter(belief.state, tags)
        keys = belief.map.keys_of(tags)
        up = up_of(self.odometer.at(view.stamp_ns)) if self.odometer.covers(view.stamp_ns) else None
        if keys and up is not None:
            prior = self._search_prior(belief, view, up)
            belief.search.look(view, belief.state, keys, prior)
        return keys

    def _search_prior(self, belief: Belief, view: CameraView, up: Floats) -> SearchPrior:
        errors = self.settings.camera.at_level(belief.cameras[view.camera].level)
        return SearchPrior(up, self.settings.level_rad, self.settings.odometry, errors.turn_rad)

    def _verify(self, belief: Belief, view: CameraView) -> None:
        """Search for another pose while all map tags contradict this one."""
        if belief.outcome.used:
            belief.contradicted, belief.contradiction = 0, np.zeros(6)
            belief.tags_ns = belief.now_ns
            belief.search.clear()
            return
        keys = self._search(belief, view)
        if not keys:
            return
        belief.contradicted += 1
        if belief.contradicted == 1:
            belief.contradicted_ns = belief.now_ns
        sights = [sight for sight in view.sights if sight.name in keys]
        belief.contradiction = max(
            (self._implied(belief, view, one, keys[one.name]) for one in sights),
            key=lambda off: float(np.linalg.norm(off[:3])),
        )
        if belief.contradicted == _LOST_AFTER:
            belief.note(f"all tags in view contradict the pose: {', '.join(sorted(keys))}")
        if belief.contradicted < _LOST_AFTER:
            return
        is_long = belief.now_ns - belief.contradicted_ns > _PATIENCE_NS
        needed = 1 if is_long else 2
        if belief.search.found(needed):
            belief.lose("all landmarks contradict the estimated pose")
            self._recover(belief, needed)

    @staticmethod
    def _implied(belief: Belief, view: CameraView, sight: Sighting, key: str) -> Floats:
        """(6,) how far off the robot is if a tag is right: of the position, and about itself."""
        poses = [pose for pose in sight.poses if pose.R is not None]
        if not poses or poses[0].R is None:
            return np.zeros(6)
        (place,) = belief.state.indices([key])
        robot, state = belief.state.robot, belief.state
        camera = camera_of(view, robot)
        R = state.landmarks_R[place] @ poses[0].R.T
        p = state.landmarks_p[place] - R @ poses[0].t
        turn = R @ camera.R.T
        at = p + turn @ (robot.p - camera.p)
        return np.concatenate([at - robot.p, se3.rotation_vector(turn)])

    @staticmethod
    def _recover(belief: Belief, least_names: int) -> None:
        """Continue at the pose that the search has found."""
        found = belief.search.found(min(least_names, belief.map.tags))
        if found is None:
            return
        if belief.has_pose:
            belief.counts["recovered"] += 1
            belief.note(f"relocalized by {', '.join(sorted(belief.search.names))}")
        belief.state, belief.is_by_imu = found, False  # its previous pose is none of odometry's
        there = {*found.keys, *(found.resting.left if found.resting else ())}
        belief.map = belief.map.copy()
        belief.map.keep(there)
        belief.outcome = ImageOutcome(used=[])
        belief.tags_ns = belief.now_ns
        belief.locate()

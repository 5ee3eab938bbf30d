"""Control of the rover: four wheels, steered by the difference of speed between its sides."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from ros_visualise.data import Odometry, PoseStamped, PoseWithCovarianceStamped, Twist
from ros_visualise.simulation.attitude import Vector, wrap, yaw_of
from ros_visualise.simulation.estimated_state import ControlPose, EstimatedState
from ros_visualise.simulation.missions import Mission
from ros_visualise.simulation.monitoring import (
    MissionMonitor,
    StallDetector,
    TipOverDetector,
    tell_place,
)
from ros_visualise.simulation.robot import Body, BodyState, Robot
from ros_visualise.simulation.robots.husky.settings import HuskyParams
from ros_visualise.simulation.route import Carrot, Route
from ros_visualise.simulation.sensors.odometry import WheelOdometry

MAX_SPEED, MAX_ACCELERATION = 1.0, 3.0  # m/s, m/s^2: data sheet; husky_control
MAX_TURN, MAX_TURN_ACCELERATION = 2.0, 6.0  # rad/s, rad/s^2: husky_control
_NAVIGATION_STEPS = 4  # of the physics: 20 ms
_LOOKAHEAD_M = 0.5
_NO_ESTIMATE = "no pose estimate"
_THERE_M = 0.1
_TURN_ON_SPOT = math.radians(50)
_INTEGRAL = 6.0  # 1/s: of the wheels' speed controllers
_INTEGRAL_LIMIT = 6.0  # rad/s


@dataclass(frozen=True)
class Wheels:
    """Radius of the wheels, and their distances along y and along x, metres."""

    radius: float
    track: float
    base: float

    @property
    def effective_track(self) -> float:
        """Track of a robot that turns like this one without slipping.

        In a turn every wheel slides sideways, the faster the farther it is from the centre along x.
        Friction acts against the slip, and its torques about the centre cancel only if the slip
        along the wheel is to the slip across it as half the wheelbase is to half the track. This
        gives a factor of 1.80; husky_control has 1.875.
        """
        return self.track * (1 + (self.base / self.track) ** 2)


class Husky(Robot):
    """Turns commands, goals and missions into a velocity, and that into wheel speeds.

    Goals and missions are steered by its true pose, or by the estimate of a navigator: without a
    new one it stands still, then aborts its mission.
    """

    def __init__(self, model: Any, data: Any, params: HuskyParams, seed: int) -> None:
        self.body = Body(model, data)
        self._data, self._params = data, params
        self._dt_s = float(model.opt.timestep)
        self._wheels = _wheels(model)
        self._odometry = WheelOdometry(params, seed)
        self._state = BodyState.of(data)  # that it steers by
        self._estimated: EstimatedState | None = None
        if params.control is ControlPose.ESTIMATE:
            start = self._state
            self._estimated = EstimatedState(start.position, yaw_of(start.attitude))
        self._held_s = 0.0  # without an estimate
        self._time_ns = 0
        self._last_turns = (0.0, 0.0)
        self._wanted = (0.0, 0.0)  # m/s and rad/s
        self._speed = self._turn = 0.0  # as limited
        self._commanded_s = -math.inf
        self._steps = 0
        self._trim = [0.0] * 4
        self._carrot: Carrot | None = None
        self._cruise = MAX_SPEED
        self._final_yaw: float | None = None
        self._stall_detector = StallDetector("husky")
        self.tip_over = TipOverDetector()
        self.mission = MissionMonitor("husky", params.mission_timeout)
        self.actions: Mapping[str, Callable[[], None]] = {"stop": self.stop}

    @property
    def doing(self) -> str:
        """Its present activity, in a few words."""
        if self.mission.failure:
            return f"failed: {self.mission.failure}"
        if self._held_s:
            return f"waiting: {_NO_ESTIMATE}"
        if self._carrot is not None:
            is_mission = self.mission.under_way
            return f"mission: {self._carrot.place}" if is_mission else "driving to goal"
        if self._wanted != (0.0, 0.0):
            return "manual control"
        return "mission over" if self.mission.finished else "waiting"

    def stop(self) -> None:
        """Stand still, and abort a goal or mission."""
        self._carrot, self._wanted = None, (0.0, 0.0)
        self.mission.cancel()

    def command(self, twist: Twist, time_s: float) -> None:
        """Follow linear x and angular z."""
        self.stop()
        self._wanted = float(twist.linear_xyz[0]), float(twist.angular_xyz[2])
        self._commanded_s = time_s

    def go_to(self, goal: PoseStamped) -> None:
        """Go straight to a goal and turn to its heading."""
        x, y, z, w = goal.quat_xyzw.tolist()
        place = (float(goal.position_xyz[0]), float(goal.position_xyz[1]), 0.0)
        self._follow(Route([self._place(), place]), 1, MAX_SPEED)
        self._final_yaw = yaw_of((w, x, y, z))
        self.mission.cancel()

    def start(self, mission: Mission) -> None:
        """Go to the mission's route and along it."""
        route = mission.route()
        self._follow(route, mission.laps, min(mission.speed, MAX_SPEED))
        self._final_yaw = None if route.closed else route.yaws[-1]
        self.mission.begin()

    def control(self, time_s: float) -> None:
        """Set the wheels' speeds for the next step."""
        self._time_ns = round(1e9 * time_s)
        if self._steps % _NAVIGATION_STEPS == 0:
            self._navigate(time_s)
        self._steps += 1
        dt, (speed, turn) = self._dt_s, self._wanted
        self._speed = _approach(self._speed, speed, MAX_SPEED, MAX_ACCELERATION * dt)
        self._turn = _approach(self._turn, turn, MAX_TURN, MAX_TURN_ACCELERATION * dt)
        aside, radius = self._turn * self._wheels.effective_track / 2, self._wheels.radius
        left, right = (self._speed - aside) / radius, (self._speed + aside) / radius
        self._spin((left, left, right, right))

    def _navigate(self, time_s: float) -> None:
        """Choose speed and angular velocity, and check that the robot moves."""
        self._state = BodyState.of(self._data)
        if self._estimated is not None:
            self._state = self._estimated.state(self._state, self._time_ns)
        self._give_up_if_stuck()
        if self._is_lost():
            self._wanted = (0.0, 0.0)
        elif self._carrot is not None:
            self._wanted = self._pursue(self._carrot)
        elif time_s - self._commanded_s > self._params.command_timeout:
            self._wanted = (0.0, 0.0)
        self._watch()

    def _is_lost(self) -> bool:
        """True if it has to wait for an estimate; after a while, abort the mission."""
        if self._estimated is None:
            return False
        is_new = self._estimated.age_s(self._time_ns) < self._params.estimate_timeout
        is_lost = self._carrot is not None and not is_new
        self._held_s = self._held_s + self._dt_s * _NAVIGATION_STEPS if is_lost else 0.0
        if self._held_s > self._params.estimate_patience and self.mission.under_way:
            reason = f"{_NO_ESTIMATE} for {self._params.estimate_patience:g} s"
            self.mission.end(f"husky aborted its mission at {tell_place(self._place())}: {reason}")
            self.stop()
        return is_lost

    def localize(self, pose: PoseWithCovarianceStamped, time_ns: int) -> None:
        if self._estimated is not None:
            self._estimated.estimate(pose, time_ns)

    def measure_odometry(self, stamp_ns: int) -> Odometry:
        """Odometry from the rotation of the wheels on each side."""
        fl, rl, fr, rr = self._data.sensordata[6:10].tolist()
        turns = (fl + rl) / 2, (fr + rr) / 2
        left, right = (
            self._wheels.radius * (now - before)
            for now, before in zip(turns, self._last_turns, strict=True)
        )
        self._last_turns = turns
        way, turn = (left + right) / 2, (right - left) / self._wheels.effective_track
        odometry = self._odometry.advance(stamp_ns, way, turn)
        if self._estimated is not None:
            self._estimated.odometry(odometry)
        return odometry

    @property
    def wheel_speed(self) -> float:
        return self._wheels.radius * float(self._data.qvel[6:10].mean())

    def _spin(self, wanted: tuple[float, float, float, float]) -> None:
        """A PI controller for each wheel: the actuator's servo is the P, its set point has the I.

        With the servo alone, wheels under load would be too slow.
        """
        speeds = self._data.qvel[6:10].tolist()  # front left, front right, rear left, rear right
        actual = speeds[0], speeds[2], speeds[1], speeds[3]
        for i in range(4):
            trim = self._trim[i] + _INTEGRAL * (wanted[i] - actual[i]) * self._dt_s
            self._trim[i] = max(-_INTEGRAL_LIMIT, min(_INTEGRAL_LIMIT, trim))
        self._data.ctrl[:] = [w + t for w, t in zip(wanted, self._trim, strict=True)]

    def _watch(self) -> None:
        """Compare the true motion with the command; rotations count as wheel speeds."""
        true = BodyState.of(self._data)
        yaw, (x, y, _) = yaw_of(true.attitude), true.position
        vx, vy, _, _, _, turn = self._data.qvel[:6].tolist()
        ahead = vx * math.cos(yaw) + vy * math.sin(yaw)
        track = self._wheels.track
        wanted, actual = (self._speed, track * self._turn), (ahead, track * turn)
        self._stall_detector.watch(wanted, actual, (x, y), self._dt_s * _NAVIGATION_STEPS)

    def _give_up_if_stuck(self) -> None:
        """Stop if it lies on its side, or its mission makes no progress."""
        dt_s, place = self._dt_s * _NAVIGATION_STEPS, self._place()
        if self.tip_over.watch(BodyState.of(self._data).attitude, dt_s):
            self.mission.end(f"husky lies on its side at {tell_place(place)}")
            self.stop()
        gone_m = 0.0 if self._carrot is None else self._carrot.progress_m(place)
        if self.mission.watch(gone_m, place, dt_s):
            self.stop()

    def _place(self) -> Vector:
        x, y, _ = self._state.position
        return x, y, 0.0

    def _yaw(self) -> float:
        return yaw_of(self._state.attitude)

    def _follow(self, route: Route, laps: int, speed: float) -> None:
        flat = [(x, y, 0.0) for x, y, _ in route.points]
        self._carrot = Carrot(Route(flat, route.closed), _LOOKAHEAD_M, laps, _THERE_M)
        self._cruise = speed

    def _pursue(self, carrot: Carrot) -> tuple[float, float]:
        """Speed and angular velocity towards the carrot.

        Source: Coulter, Implementation of the pure pursuit path tracking algorithm, 1992.
        """
        place = self._place()
        x, y, _ = carrot.advance(place, 4 * self._cruise * self._dt_s * _NAVIGATION_STEPS)
        dx, dy = x - place[0], y - place[1]
        away = math.hypot(dx, dy)
        if carrot.at_end and away < _THERE_M:
            return self._arrive()
        off = wrap(math.atan2(dy, dx) - self._yaw())
        if abs(off) > _TURN_ON_SPOT:
            return 0.0, math.copysign(min(1.2, 2 * abs(off)), off)
        speed = self._cruise * max(0.15, math.cos(off)) * min(1.0, away / (0.6 * _LOOKAHEAD_M))
        return speed, 2 * speed * math.sin(off) / max(away, 0.3)

    def _arrive(self) -> tuple[float, float]:
        if self._final_yaw is not None:
            off = wrap(self._final_yaw - self._yaw())
            if abs(off) > 0.02:
                return 0.0, max(-1.0, min(1.0, 2.5 * off))
        self._carrot = None
        self.mission.end()
        return 0.0, 0.0


def _approach(now: float, wanted: float, limit: float, step: float) -> float:
    wanted = max(-limit, min(limit, wanted))
    return now + max(-step, min(step, wanted - now))


def _wheels(model: Any) -> Wheels:
    """Dimensions from the model; all four wheels are alike."""
    x, y, _ = model.body("front_left_wheel").pos.tolist()
    return Wheels(float(model.geom("front_left_tread").size[0]), 2 * y, 2 * x)

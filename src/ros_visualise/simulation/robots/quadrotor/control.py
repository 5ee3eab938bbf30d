"""Control of the quadrotor: commands, goals and missions move a reference, which it follows."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from ros_visualise.data import Odometry, PoseStamped, PoseWithCovarianceStamped, Twist
from ros_visualise.simulation.attitude import Vector, yaw_of
from ros_visualise.simulation.estimated_state import ControlPose, EstimatedState
from ros_visualise.simulation.missions import Mission
from ros_visualise.simulation.monitoring import (
    MissionMonitor,
    StallDetector,
    TipOverDetector,
    tell_place,
)
from ros_visualise.simulation.robot import Body, BodyState, Robot
from ros_visualise.simulation.robots.quadrotor.flight import FlightController, read_airframe
from ros_visualise.simulation.robots.quadrotor.lander import Lander
from ros_visualise.simulation.robots.quadrotor.mode import (
    FlightMode,
    TouchDownDetector,
    tell_flight,
)
from ros_visualise.simulation.robots.quadrotor.reference import (
    MAX_SPEED,
    Reference,
    VelocityCommand,
)
from ros_visualise.simulation.robots.quadrotor.settings import QuadrotorParams
from ros_visualise.simulation.robots.quadrotor.wind import Wind
from ros_visualise.simulation.route import Carrot, Route
from ros_visualise.simulation.sensors.odometry import VisualInertialOdometry

TAKE_OFF_M = 2.0
_LOWEST_M = 1.0  # least height of goals and missions
_NAVIGATION_STEPS = 4  # of the physics: every 20 ms
_CLIMB, _SINK = 1.2, 0.6  # m/s, taking off and landing
_LOOKAHEAD_S = 1.2  # at a steady speed the reference is 1 s behind its target
_REACH_M = 0.6  # the reference is never farther from the robot; in free flight it is 0.27
_HELD_M = 0.5  # farther from the reference than this, the robot is blocked
_NO_ESTIMATE = "no pose estimate"
_ARRIVED_M, _THERE_M = 0.12, 0.3  # of the reference, of the robot


class Quadrotor(Robot):
    """Controlled by its true state, or by the estimate of a navigator.

    Without a new estimate it holds, then aborts its mission and lands where it is. The pad is known
    only from its odometry and observed poses.
    """

    def __init__(self, model: Any, data: Any, params: QuadrotorParams, seed: int) -> None:
        self.body = Body(model, data)
        self._data, self._params = data, params
        self._dt_s = float(model.opt.timestep)
        self._long_dt_s = _NAVIGATION_STEPS * self._dt_s
        self._steps = self._time_ns = 0
        self._controller = FlightController(read_airframe(model))
        self._wind = Wind(model, data, params, seed)
        state = BodyState.of(self._data)
        self._odometry = VisualInertialOdometry(params, seed, state.position, state.attitude)
        self._estimated: EstimatedState | None = None
        if params.control is ControlPose.ESTIMATE:
            self._estimated = EstimatedState(state.position, yaw_of(state.attitude))
        self._held_s = 0.0  # without an estimate
        self._is_rising = False
        self._mode = FlightMode.LANDED
        self._home = state.position
        self._reference = Reference(state.position, yaw_of(state.attitude))
        self._carrot: Carrot | None = None
        self._route: Route | None = None  # of the mission
        self._cruise = _CLIMB
        self._next: list[Callable[[], None]] = []  # to do at the end of the route
        self._command = VelocityCommand()
        self._touch_down = TouchDownDetector(data)
        self._lander: Lander | None = None
        self._own: Odometry | None = None
        self._stall_detector = StallDetector("quadrotor")
        self.tip_over = TipOverDetector()
        self.mission = MissionMonitor("quadrotor", params.mission_timeout)
        self.actions: Mapping[str, Callable[[], None]] = {
            "take_off": self.take_off,
            "land": self.land,
            "stop": self.stop,
        }

    @property
    def doing(self) -> str:
        """Its present activity, in a few words."""
        if self._held_s:
            landing = "landing" if self._mode is FlightMode.LANDING else "holding"
            return f"{landing}: {_NO_ESTIMATE}"
        return tell_flight(self._mode, self.mission, self._carrot, self._route)

    def take_off(self) -> None:
        self._cancel()
        self._rise(TAKE_OFF_M)

    def land(self) -> None:
        self._cancel()
        self._descend()

    def stop(self) -> None:
        """Hover, and abort a goal or mission."""
        self._cancel()
        self._carrot = None
        if self._mode is not FlightMode.LANDED:
            self._mode = FlightMode.FLYING
            place = self._state().position
            if math.dist(self._reference.position, place) > _HELD_M:
                self._reference.move(place, (0.0, 0.0, 0.0))
            self._fly([], _CLIMB)

    def command(self, twist: Twist, time_s: float) -> None:
        """Follow a velocity in level axes that turn with the heading, and rotate by angular z.

        On the ground it waits for an upward velocity.
        """
        if self._mode is FlightMode.LANDED and twist.linear_xyz[2] <= 0:
            return
        if self._mode is FlightMode.LANDED:
            self._begin_flight()
        self._cancel()
        self._carrot, self._mode = None, FlightMode.COMMANDED
        self._command.give(twist, time_s)

    def go_to(self, goal: PoseStamped) -> None:
        """Take off if landed, fly to a goal and turn to its heading.

        A goal on the ground plane, as sent by rviz's tool, is approached at the present height.
        """
        x, y, z, w = goal.quat_xyzw.tolist()
        px, py, pz = goal.position_xyz.tolist()
        if pz <= 0:
            is_landed, height_m = self._mode is FlightMode.LANDED, self._reference.position[2]
            pz = TAKE_OFF_M if is_landed else max(height_m, _LOWEST_M)
        yaw = yaw_of((w, x, y, z))
        self._cancel()
        self._after_take_off(pz, lambda: self._fly([(px, py, pz)], 2.0, yaw=yaw))

    def start(self, mission: Mission) -> None:
        """Take off, fly the mission, return to the take-off point and land there.

        A mission with another landing target goes there as soon as it is visible.
        """
        self._cancel()
        self.mission.begin()
        if mission.land_on:
            self._lander = Lander(mission.height)
        if not mission.has_route:
            self._rise(mission.height)
            return
        route, speed = mission.route(), min(mission.speed, MAX_SPEED)
        self._route = route
        first = route.points[0]
        self._after_take_off(first[2], lambda: self._fly([first], speed))
        self._next.append(
            lambda: self._go_along(
                Carrot(route, speed * _LOOKAHEAD_S, mission.laps, _THERE_M), speed
            )
        )
        if mission.land_on:
            return
        if mission.land:
            x, y, _ = self._home
            self._next.append(lambda: self._fly([(x, y, self._reference.position[2])], speed))
            self._next.append(self._descend)
        self._next.append(self.mission.end)

    @property
    def lands_visually(self) -> bool:
        return self._lander is not None and not self.mission.finished

    def see(self, target: Odometry) -> None:
        if self._lander is not None:
            self._lander.see(target)

    def localize(self, pose: PoseWithCovarianceStamped, time_ns: int) -> None:
        if self._estimated is not None:
            self._estimated.estimate(pose, time_ns)

    def control(self, time_s: float) -> None:
        self._wind.advance()
        self._time_ns = round(1e9 * time_s)
        state = self._state()
        if self._steps % _NAVIGATION_STEPS == 0:
            self._navigate(time_s, state)
        self._steps += 1
        if self._mode is FlightMode.LANDED:
            self._data.ctrl[:] = 0.0
            return
        self._reference.advance(self._dt_s)
        target = self._reference.set_point
        self._data.ctrl[:] = self._controller.control(state, target, self._dt_s)

    def _state(self) -> BodyState:
        """The state that it is controlled by."""
        true = BodyState.of(self._data)
        return true if self._estimated is None else self._estimated.state(true, self._time_ns)

    def _navigate(self, time_s: float, state: BodyState) -> None:
        """Choose the motion of the reference, and check that the robot follows it."""
        self._give_up_if_stuck(state)
        self._hold_if_lost(state)
        if self._mode is FlightMode.LANDED:
            return
        self._steer(time_s, state)
        self._keep_near(state)
        if self._goes_down(state):
            self._detect_landing()
        else:
            self._touch_down.reset()

    def measure_odometry(self, stamp_ns: int) -> Odometry:
        """Visual-inertial odometry."""
        body = self.body
        self._own = self._odometry.advance(stamp_ns, body.position, body.attitude, *body.velocity())
        if self._estimated is not None:
            self._estimated.odometry(self._own)
        return self._own

    def _begin_flight(self) -> None:
        """Turn the motors on."""
        state = self._state()
        self._controller.reset()
        self._mode = FlightMode.FLYING
        self._home = state.position
        self._reference.begin(state.position, yaw_of(state.attitude))

    def _rise(self, height_m: float) -> None:
        if self._mode is FlightMode.LANDED:
            self._begin_flight()
        self._mode = FlightMode.FLYING
        x, y, z = self._reference.position
        self._fly([(x, y, max(z, height_m))], _CLIMB)
        self._is_rising = True

    def _after_take_off(self, height_m: float, then: Callable[[], None]) -> None:
        if self._mode is FlightMode.LANDED:
            self._rise(max(height_m, _LOWEST_M))
            self._next.append(then)
        else:
            self._mode = FlightMode.FLYING
            then()

    def _fly(self, points: list[Vector], speed: float, yaw: float | None = None) -> None:
        """Fly through points, starting from the reference."""
        route = Route([self._reference.position, *points], yaws=[yaw] * (len(points) + 1))
        self._go_along(Carrot(route, speed * _LOOKAHEAD_S), speed)

    def _go_along(self, carrot: Carrot, speed: float) -> None:
        self._carrot, self._cruise, self._is_rising = carrot, speed, False
        self.mission.begin_leg()

    def _descend(self) -> None:
        if self._mode is not FlightMode.LANDED:
            self._mode, self._carrot = FlightMode.LANDING, None
            self._touch_down.reset()
            self._command.set((0.0, 0.0, -_SINK))
            self.mission.begin_leg()

    def _cancel(self) -> None:
        """Abort a mission and all pending steps."""
        self._next, self._lander = [], None
        self.mission.cancel()

    def _give_up_if_stuck(self, state: BodyState) -> None:
        """Turn the motors off if it has tipped over; hover if its mission makes no progress."""
        place = state.position
        if self.tip_over.watch(BodyState.of(self._data).attitude, self._long_dt_s):
            self.mission.end(f"quadrotor tipped over at {tell_place(place)}: motors off")
            self._cancel()
            self._carrot, self._mode = None, FlightMode.LANDED
        gone_m = self._carrot.progress_m(place) if self._carrot else -place[2]
        if self.mission.watch(gone_m, place, self._long_dt_s):
            self.stop()

    def _hold_if_lost(self, state: BodyState) -> None:
        """Hold without a new estimate; after a while abort the mission and land.

        It rises without one, and it lands on a target that it sees.
        """
        if self._estimated is None or self._mode is FlightMode.LANDING:
            return
        is_new = self._estimated.age_s(self._time_ns) < self._params.estimate_timeout
        is_free = self._mode is not FlightMode.FLYING or self._is_rising
        self._held_s = 0.0 if is_new or is_free else self._held_s + self._long_dt_s
        if self._held_s > self._params.estimate_patience and self.mission.under_way:
            reason = f"{_NO_ESTIMATE} for {self._params.estimate_patience:g} s"
            failure = f"quadrotor aborted its mission at {tell_place(state.position)}: {reason}"
            self._lander, self._next = None, [lambda: self.mission.end(failure)]
            self._descend()

    def _steer(self, time_s: float, state: BodyState) -> None:
        """Set the acceleration of the reference."""
        if self._lander is not None and self._lander.has_seen and self._mode is FlightMode.FLYING:
            self._mode, self._carrot, self._next = FlightMode.HOMING, None, [self.mission.end]
            self.mission.begin_leg()
        if self._mode is FlightMode.COMMANDED:
            self._command.expire(time_s, self._params.command_timeout)
        if self._mode is FlightMode.HOMING and self._lander is not None:
            self._lander.steer(self._reference, self._own, state)
        elif self._mode is FlightMode.FLYING and self._held_s:
            self._reference.take_up((0.0, 0.0, 0.0), 0.0)
        elif self._mode is FlightMode.FLYING and self._carrot is not None:
            self._follow(self._carrot, state.position)
        else:
            velocity = self._command.velocity(self._reference.yaw)
            self._reference.take_up(velocity, self._command.turn)

    def _keep_near(self, state: BodyState) -> None:
        """Hold the reference back when the robot is blocked."""
        off = self._reference.hold_within(_REACH_M, state.position, state.velocity)
        away = math.hypot(*off)
        if away > _REACH_M:
            self._controller.reset()
        wanted = off if away > _HELD_M else (0.0, 0.0, 0.0)
        self._stall_detector.watch(wanted, state.velocity, state.position[:2], self._long_dt_s)

    def _follow(self, carrot: Carrot, place: Vector) -> None:
        """Pull the reference along the route; at its end, do the next step."""
        target = carrot.advance(self._reference.position, self._cruise * self._long_dt_s)
        off_m = math.dist(target, self._reference.position)
        is_there = off_m < _ARRIVED_M and math.dist(target, place) < _THERE_M
        if carrot.at_end and is_there and self._next:
            self._next.pop(0)()
        self._reference.pull_to(target, carrot.yaw)

    def _goes_down(self, state: BodyState) -> bool:
        """True if it lands, or is commanded down and something holds it up."""
        if self._mode is FlightMode.HOMING:
            return self._lander is not None and self._lander.touches_down
        sinks = self._mode is FlightMode.COMMANDED and self._command.sinks
        is_held = self._reference.position[2] < state.position[2] - _HELD_M
        return self._mode is FlightMode.LANDING or (sinks and is_held)

    def _detect_landing(self) -> None:
        """Turn the motors off when it stands."""
        true = BodyState.of(self._data)
        if self._touch_down.watch(true.position, true.velocity, self._long_dt_s):
            self._mode, self._held_s = FlightMode.LANDED, 0.0
            if self._next:
                self._next.pop(0)()

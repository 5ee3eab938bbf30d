"""The quadrotor: what it is asked for becomes a moving point that its controller flies after."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from enum import Enum
from typing import Any

from ros_visualise.data import Odometry, PoseStamped, Twist
from ros_visualise.simulation.attitude import Vector, wrap, yaw_of
from ros_visualise.simulation.flight import Airframe, FlightController, SetPoint, State
from ros_visualise.simulation.missions import Mission
from ros_visualise.simulation.model import BASE
from ros_visualise.simulation.robots.balance import Balance
from ros_visualise.simulation.robots.base import Body
from ros_visualise.simulation.robots.errand import Errand
from ros_visualise.simulation.robots.progress import Progress, tell_place
from ros_visualise.simulation.route import Carrot, Route
from ros_visualise.simulation.sensors.odometry import VisualInertialOdometry
from ros_visualise.simulation.settings import QuadrotorParams

_UNDERSIDE_M = 0.05  # what it touches further below carries it
TAKE_OFF_M = 2.0
_LOWEST_M = 1.0  # that it flies to a goal or to a mission
MAX_SPEED, MAX_CLIMB = 5.0, 2.5  # m/s
MAX_ACCELERATION = 3.0  # m/s^2
MAX_TURN = math.radians(70)  # per second
_NAVIGATION_STEPS = 4  # of the physics: every 20 ms
_CLIMB, _SINK = 1.2, 0.6  # m/s, taking off and landing
_STIFFNESS = 2.0  # 1/s: how the point follows the carrot
_LEASH_S = 1.2  # that the carrot is ahead at most; at a steady speed it is 2 / _STIFFNESS
_REACH_M = 0.6  # that the point is away from the robot at most; in free flight it is 0.27
_HELD_M = 0.5  # further behind than that something holds it
_LANDED_S = 0.4
_ARRIVED_M, _THERE_M = 0.12, 0.3  # of the point, of the robot
_COURSE_M_S = 0.4  # slower than that there is no course to head to


class Mode(Enum):
    """What it is doing."""

    LANDED = "landed"
    FLYING = "flying"  # after a carrot, or standing in the air
    COMMANDED = "commanded"
    LANDING = "landing"


class Quadrotor:
    """It knows its true state: estimating that is for those who use its sensors."""

    def __init__(self, model: Any, data: Any, params: QuadrotorParams, seed: int) -> None:
        self.body = Body(model, data)
        self._data, self._params = data, params
        self._dt_s = float(model.opt.timestep)
        self._long_dt_s = _NAVIGATION_STEPS * self._dt_s
        self._steps = 0
        self._controller = FlightController(_airframe(model))
        state = self._state()
        self._odometry = VisualInertialOdometry(params, seed, state.position, state.attitude)
        self._mode = Mode.LANDED
        self._home = self._point = state.position
        self._velocity = self._acceleration = (0.0, 0.0, 0.0)
        self._yaw, self._yaw_rate = yaw_of(state.attitude), 0.0
        self._carrot: Carrot | None = None
        self._cruise = _CLIMB
        self._next: list[Callable[[], None]] = []  # what comes when the carrot was reached
        self._twist = ((0.0, 0.0, 0.0), 0.0)
        self._commanded_s = -math.inf
        self._touched_s = 0.0
        self._progress = Progress("quadrotor")
        self.balance = Balance()
        self.errand = Errand("quadrotor", params.mission_timeout)
        self.actions: Mapping[str, Callable[[], None]] = {
            "take_off": self.take_off,
            "land": self.land,
            "stop": self.stop,
        }

    def take_off(self) -> None:
        """Rise and stay there."""
        self._forget()
        self._rise(TAKE_OFF_M)

    def land(self) -> None:
        """Come down where it is."""
        self._forget()
        self._descend()

    def stop(self) -> None:
        """Stand in the air, and give up what it was doing."""
        self._forget()
        self._carrot = None
        if self._mode is not Mode.LANDED:
            self._mode = Mode.FLYING
            place = self._state().position
            if math.dist(self._point, place) > _HELD_M:
                self._point, self._velocity = place, (0.0, 0.0, 0.0)
            self._fly([self._point], _CLIMB)

    def command(self, twist: Twist, time_s: float) -> None:
        """Go with that velocity in axes that turn with the heading alone, and turn by angular z.

        On the ground it waits for one that goes up.
        """
        x, y, z = twist.linear_xyz.tolist()
        if self._mode is Mode.LANDED and z <= 0:
            return
        if self._mode is Mode.LANDED:
            self._wake()
        self._forget()
        self._carrot, self._mode = None, Mode.COMMANDED
        self._twist, self._commanded_s = ((x, y, z), float(twist.angular_xyz[2])), time_s

    def go_to(self, goal: PoseStamped) -> None:
        """Fly there, after taking off where need be, and turn to its heading.

        To a goal on the ground plane, as rviz's tool sends it, it flies as high as it is.
        """
        x, y, z, w = goal.quat_xyzw.tolist()
        px, py, pz = goal.position_xyz.tolist()
        if pz <= 0:
            pz = TAKE_OFF_M if self._mode is Mode.LANDED else max(self._point[2], _LOWEST_M)
        yaw = yaw_of((w, x, y, z))
        self._forget()
        self._after_take_off(pz, lambda: self._fly([self._point, (px, py, pz)], 2.0, yaw=yaw))

    def start(self, mission: Mission) -> None:
        """Take off, fly to the mission's way and along it, return to where it took off and land."""
        self._forget()
        self.errand.begin()
        route, speed = mission.route(), min(mission.speed, MAX_SPEED)
        first = route.points[0]
        self._after_take_off(first[2], lambda: self._fly([self._point, first], speed))
        self._next.append(
            lambda: self._go_along(Carrot(route, speed * _LEASH_S, mission.laps, _THERE_M), speed)
        )
        if mission.land:
            x, y, _ = self._home
            self._next.append(lambda: self._fly([self._point, (x, y, self._point[2])], speed))
            self._next.append(self._descend)
        self._next.append(self.errand.end)

    def control(self, time_s: float) -> None:
        """Thrusts for the next step."""
        state = self._state()
        if self._steps % _NAVIGATION_STEPS == 0:
            self._navigate(time_s, state)
        self._steps += 1
        if self._mode is Mode.LANDED:
            self._data.ctrl[:] = 0.0
            return
        self._advance()
        target = SetPoint(
            self._point, self._velocity, self._acceleration, self._yaw, self._yaw_rate
        )
        self._data.ctrl[:] = self._controller.control(state, target, self._dt_s)

    def _navigate(self, time_s: float, state: State) -> None:
        """Choose how the point goes on, and see whether it can."""
        self._give_up_if_lost(state)
        if self._mode is Mode.LANDED:
            return
        self._acceleration = self._steer(time_s, state.position)
        self._keep_near(state)
        if self._mode is Mode.LANDING or self._is_sent_down(state):
            self._feel_ground(state)
        else:
            self._touched_s = 0.0

    def measure_odometry(self, stamp_ns: int) -> Odometry:
        """What a camera and an IMU make of its motion."""
        body = self.body
        return self._odometry.advance(stamp_ns, body.position, body.attitude, *body.velocity())

    def _state(self) -> State:
        x, y, z, qw, qx, qy, qz = self._data.qpos[:7].tolist()
        vx, vy, vz, p, q, r = self._data.qvel[:6].tolist()
        return State((x, y, z), (qw, qx, qy, qz), (vx, vy, vz), (p, q, r))

    def _wake(self) -> None:
        """Begin to fly from where it stands."""
        state = self._state()
        self._controller.reset()
        self._mode = Mode.FLYING
        self._home = self._point = state.position
        self._velocity = self._acceleration = (0.0, 0.0, 0.0)
        self._yaw, self._yaw_rate = yaw_of(state.attitude), 0.0

    def _rise(self, height_m: float) -> None:
        if self._mode is Mode.LANDED:
            self._wake()
        self._mode = Mode.FLYING
        x, y, z = self._point
        self._fly([self._point, (x, y, max(z, height_m))], _CLIMB)

    def _after_take_off(self, height_m: float, then: Callable[[], None]) -> None:
        if self._mode is Mode.LANDED:
            self._rise(max(height_m, _LOWEST_M))
            self._next.append(then)
        else:
            self._mode = Mode.FLYING
            then()

    def _fly(self, points: list[Vector], speed: float, yaw: float | None = None) -> None:
        self._go_along(Carrot(Route(points, yaws=[yaw] * len(points)), speed * _LEASH_S), speed)

    def _go_along(self, carrot: Carrot, speed: float) -> None:
        self._carrot, self._cruise = carrot, speed
        self.errand.begin_leg()

    def _descend(self) -> None:
        if self._mode is not Mode.LANDED:
            self._mode, self._carrot, self._touched_s = Mode.LANDING, None, 0.0
            self._twist = ((0.0, 0.0, -_SINK), 0.0)
            self.errand.begin_leg()

    def _forget(self) -> None:
        """Give up what was to come next, and a mission."""
        self._next = []
        self.errand.drop()

    def _give_up_if_lost(self, state: State) -> None:
        """Turn the motors off where it has tipped over; stand where a mission makes no progress."""
        place = state.position
        if self.balance.watch(state.attitude, self._long_dt_s):
            self.errand.end(f"quadrotor tipped over at {tell_place(place)}: motors off")
            self._forget()
            self._carrot, self._mode = None, Mode.LANDED
        gone_m = self._carrot.reached_m(place) if self._carrot else -place[2]
        if self.errand.watch(gone_m, place, self._long_dt_s):
            self.stop()

    def _steer(self, time_s: float, place: Vector) -> Vector:
        """The acceleration of the point."""
        if (
            self._mode is Mode.COMMANDED
            and time_s - self._commanded_s > self._params.command_timeout
        ):
            self._twist = ((0.0, 0.0, 0.0), 0.0)
        if self._mode is Mode.FLYING and self._carrot is not None:
            pull = self._pull(self._carrot, place)
        else:
            pull = [3.0 * (w - v) for w, v in zip(self._commanded(), self._velocity, strict=True)]
        size = math.hypot(*pull)
        share = min(1.0, MAX_ACCELERATION / size) if size else 1.0
        ax, ay, az = (share * a for a in pull)
        return ax, ay, az

    def _advance(self) -> None:
        """Move the point, and what it heads to, by one step."""
        ax, ay, az = self._acceleration
        (x, y, z), (vx, vy, vz), dt = self._point, self._velocity, self._dt_s
        vx, vy, vz = vx + ax * dt, vy + ay * dt, vz + az * dt
        self._point, self._velocity = (x + vx * dt, y + vy * dt, z + vz * dt), (vx, vy, vz)
        self._yaw = wrap(self._yaw + self._yaw_rate * dt)

    def _keep_near(self, state: State) -> None:
        """Begin anew from where it is held, lest the point goes on without it."""
        off = [p - s for p, s in zip(self._point, state.position, strict=True)]
        away = math.hypot(*off)
        if away > _REACH_M:
            x, y, z = (s + _REACH_M / away * o for s, o in zip(state.position, off, strict=True))
            self._point, self._velocity = (x, y, z), state.velocity
            self._controller.reset()
        wanted = off if away > _HELD_M else (0.0, 0.0, 0.0)
        self._progress.watch(wanted, state.velocity, state.position[:2], self._long_dt_s)

    def _pull(self, carrot: Carrot, place: Vector) -> list[float]:
        """Acceleration of a critically damped spring to the carrot."""
        lead = carrot.lead(self._point, self._cruise * self._long_dt_s)
        off = [c - p for c, p in zip(lead, self._point, strict=True)]
        is_there = math.hypot(*off) < _ARRIVED_M and math.dist(lead, place) < _THERE_M
        if carrot.at_end and is_there and self._next:
            self._next.pop(0)()
        self._head(carrot.yaw)
        k = _STIFFNESS
        return [k * k * d - 2 * k * v for d, v in zip(off, self._velocity, strict=True)]

    def _head(self, wanted: float | None) -> None:
        """Turn to a heading; to the course where none is asked for."""
        vx, vy, _ = self._velocity
        course = math.atan2(vy, vx) if math.hypot(vx, vy) > _COURSE_M_S else self._yaw
        off = wrap((course if wanted is None else wanted) - self._yaw)
        self._yaw_rate = max(-MAX_TURN, min(MAX_TURN, 2.0 * off))

    def _commanded(self) -> Vector:
        """The velocity in the world that was commanded, within limits."""
        (forward, left, up), turn = self._twist
        share = min(1.0, MAX_SPEED / max(math.hypot(forward, left), 1e-9))
        self._yaw_rate = max(-MAX_TURN, min(MAX_TURN, turn))
        c, s = share * math.cos(self._yaw), share * math.sin(self._yaw)
        return c * forward - s * left, s * forward + c * left, max(-MAX_CLIMB, min(MAX_CLIMB, up))

    def _is_sent_down(self, state: State) -> bool:
        """By a velocity, and does not come down."""
        sinks = self._mode is Mode.COMMANDED and self._twist[0][2] < 0
        return sinks and self._point[2] < state.position[2] - _HELD_M

    def _feel_ground(self, state: State) -> None:
        """Turn the motors off when it stands."""
        below = state.position[2] - _UNDERSIDE_M
        rests = any(self._data.contact[i].pos[2] < below for i in range(self._data.ncon))
        stands = rests and abs(state.velocity[2]) < 0.15
        self._touched_s = self._touched_s + self._long_dt_s if stands else 0.0
        if self._touched_s > _LANDED_S:
            self._mode = Mode.LANDED
            if self._next:
                self._next.pop(0)()


def _airframe(model: Any) -> Airframe:
    """What the model says; its four motors are alike."""
    base, motor = model.body(BASE), model.site("motor_front_left")
    jx, jy, jz = base.inertia.tolist()
    return Airframe(
        mass=float(base.subtreemass[0]),
        inertia=(jx, jy, jz),
        arm=float(motor.pos[0]),
        drag=float(model.actuator_gear[0, 5]),
        max_thrust=float(model.actuator_ctrlrange[0, 1]),
    )

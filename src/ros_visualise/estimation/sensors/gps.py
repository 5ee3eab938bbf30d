"""GPS: fixes that correct the robot, and the position of the map on the Earth.

A fix has a slowly changing error, shared by the fixes of a minute, and a white one. Without a given
origin, the map's position on the Earth is estimated once the robot has moved far enough to tell its
heading. With one, a new map has that origin as soon as its heading is known.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import param
from ros_visualise.data import Floats, NavSatFix
from ros_visualise.estimation.belief import Belief
from ros_visualise.estimation.landmark_map import MapMode
from ros_visualise.estimation.robot import DATUM, POSE, YAW, OwnStates, RobotState, core, own_states
from ros_visualise.estimation.sensors import Expected, Prior, Reading, Sensor
from ros_visualise.geometry import rotations, se3
from ros_visualise.geometry.geodesy import LocalPlane

SLOW = own_states("slowly varying error of GPS", 3)
"""Slow error, in standard deviations."""
JUMP = own_states("jump of GPS", 3)
"""Error of fixes that have contradicted the estimate, metres east, north and up."""

_BASE = 10.0  # least distance of two fixes that give the heading, standard deviations
_VAGUE_M, _VAGUE_RAD = 100.0, 0.3
_HEIGHT = 2.0  # ratio of vertical to horizontal error, if not reported
_LEVEL_RAD = 0.1  # heading sigma below which a new map turns to its origin
_ASTRAY_RAD = 0.2  # heading sigma of a robot that GPS contradicts
_HELD = 2.0  # how long jumps are feared, in time constants of GPS
_LIKELIER = 4.0  # its variance by that of a GPS that jumps


@dataclass(frozen=True)
class GpsErrorParams:
    """Parameters of GPS errors."""

    gps: bool = param(True, "use GPS if available", group="gps")
    gps_origin: str = param(
        "",
        "latitude, longitude, altitude of the origin of a map whose x axis points east, "
        "such as 49.0, 8.4, 116; empty: estimated from the fixes",
        group="gps",
        restart=True,
    )
    gps_sigma: float = param(
        2.0,
        "standard deviation east and north if the receiver reports none, m",
        min=1e-3,
        max=1000,
        slider=(0.01, 10),
        group="gps",
    )
    gps_slow: float = param(
        0.97,
        "fraction of a fix's variance that is due to slowly changing errors; the rest is white"
        " noise",
        min=0,
        max=0.999,
        group="gps",
    )
    gps_time: float = param(
        60.0,
        "time constant of the slowly varying part, seconds",
        min=0.1,
        max=1e5,
        slider=(1, 600),
        group="gps",
    )

    def __post_init__(self) -> None:
        """Reject an invalid origin."""
        _ = self.origin

    @property
    def origin(self) -> tuple[float, float, float] | None:
        """The position given by `gps_origin`.

        Raises:
            ParameterError: it is invalid.
        """
        if not self.gps_origin.strip():
            return None
        try:
            latitude, longitude, altitude = map(float, self.gps_origin.split(","))
        except ValueError:
            latitude = longitude = altitude = math.nan
        if not (abs(latitude) <= 90 and abs(longitude) <= 180 and math.isfinite(altitude)):
            raise ParameterError(
                f"gps_origin={self.gps_origin}: give latitude, longitude, altitude: 49.0, 8.4, 116"
            )
        return latitude, longitude, altitude


class EarthFrame(NamedTuple):
    """The map's place on the Earth, as a belief remembers it.

    Attributes:
        plane: where metres east, north and up are counted from.
        is_placed: True if its place in the map is estimated.
        first: the first fix, metres, and the antenna's place in the map then.
        jump_m: standard deviation of jumps, since fixes have contradicted the estimate.
        at_ns: time of the last fix.
    """

    plane: LocalPlane
    is_placed: bool
    first: tuple[Floats, Floats] | None = None
    jump_m: float = 0.0
    at_ns: int = 0


class GpsModel(Sensor):
    """Fixes: three numbers, metres east, north and up of an origin."""

    name, message, params = "gps", NavSatFix, GpsErrorParams
    topic = "fix"

    def read(self, message: NavSatFix, params: GpsErrorParams) -> tuple[Floats, Floats] | str:
        """Latitude, longitude (degrees) and altitude, and the covariance in metres."""
        values = np.array([message.latitude, message.longitude, message.altitude])
        if message.status < 0:
            return "no fix"
        if not np.isfinite(values).all():
            return "is not a number"
        covariance = message.covariance
        is_known = message.covariance_type and np.isfinite(covariance).all()
        if not (is_known and np.linalg.eigvalsh(covariance)[0] > 0):
            covariance = np.diag([1, 1, _HEIGHT**2]) * params.gps_sigma**2
        return values, covariance

    def states(self, params: GpsErrorParams) -> Mapping[OwnStates, Prior]:
        """The slow error, and none of a jump so far."""
        return {SLOW: Prior(1.0, time_s=params.gps_time), JUMP: Prior(0.0)}

    def apply(self, belief: Belief, reading: Reading, params: GpsErrorParams) -> None:
        """Correct a belief, once the map's place on the Earth is known."""
        earth: EarthFrame | None = belief.memory.get(self.name)
        if earth is None:
            origin = params.origin
            plane = LocalPlane(*(origin or reading.values.tolist()))
            builds = belief.map.rules.mode is MapMode.BUILD
            is_placed = origin is not None and (belief.is_start_known or not builds)
            earth = EarthFrame(plane, is_placed)
            belief.remember(self.name, earth)
            if origin and not is_placed and belief.is_located:
                belief.reason = "not localized: drive on, to find the map's heading by GPS"
        reading = reading._replace(values=earth.plane.to_enu(reading.values))
        if not earth.is_placed:
            self._place(belief, reading, earth)
            belief.counts["gps unused"] += 1
            return
        self._age(belief, earth, params)
        super().apply(belief, reading, params)
        heading = DATUM.stop - 1
        turns = belief.map.rules.mode is MapMode.BUILD and params.origin and belief.reason
        if turns and belief.state.P[heading, heading] < _LEVEL_RAD**2:
            self._turn_to_origin(belief)

    def _place(self, belief: Belief, reading: Reading, earth: EarthFrame) -> None:
        """Estimate the origin's place in the map once the robot has moved far enough."""
        robot = belief.state.robot
        at = robot.p + robot.R @ reading.mounting.p
        if earth.first is None:
            belief.remember(self.name, earth._replace(first=(reading.values, at)))
            return
        (dx, dy) = (at - earth.first[1])[:2]
        east, north = (reading.values - earth.first[0])[:2]
        far = _BASE * np.sqrt(np.trace(reading.covariance[:2, :2]) / 2)
        if min(np.hypot(dx, dy), np.hypot(east, north)) < far:
            return
        yaw = np.arctan2(dy, dx) - np.arctan2(north, east)
        R = rotations.to_matrix(rotations.from_rpy([0.0, 0.0, yaw]))
        state = belief.state.copy()
        state.forget(DATUM)
        change = se3.about_origin(at)[np.ix_(YAW, YAW)]
        vague = np.diag([_VAGUE_M**2] * 3 + [_VAGUE_RAD**2])
        state.inflate(DATUM, change @ vague @ change.T)
        state.robot = replace(state.robot, datum_R=R, datum_p=at - R @ reading.values)
        belief.state = state
        belief.remember(self.name, earth._replace(is_placed=True))

    def _age(self, belief: Belief, earth: EarthFrame, params: GpsErrorParams) -> None:
        """Let a jump change; the longer fixes agree with the robot's motion, the less is left."""
        seconds = (belief.now_ns - earth.at_ns) / 1e9
        jump_m = earth.jump_m * math.exp(-seconds / (_HELD * params.gps_time))
        belief.remember(self.name, earth._replace(jump_m=jump_m, at_ns=belief.now_ns))
        if not earth.jump_m:
            return
        keep, noise = np.ones(core()), np.zeros(core())
        keep[JUMP.rows] = math.exp(-seconds / params.gps_time)
        noise[JUMP.rows] = (1 - keep[JUMP.rows] ** 2) * jump_m**2
        belief.state = belief.state.copy()
        belief.state.age(keep, noise)
        robot = belief.state.robot
        belief.state.robot = robot.with_own(JUMP, robot[JUMP] * keep[JUMP.rows])

    @staticmethod
    def _turn_to_origin(belief: Belief) -> None:
        """Make the origin that of the map."""
        robot = belief.state.robot
        belief.state = belief.state.seen_from(robot.datum_R, robot.datum_p)
        belief.map = belief.map.seen_from(robot.datum_R, robot.datum_p)
        belief.locate()
        belief.note("the map's x axis now points east, as measured by GPS")

    def expect(self, robot: RobotState, reading: Reading, params: GpsErrorParams) -> Expected:
        """The antenna's position east, north and up."""
        at = robot.p + robot.R @ reading.mounting.p
        back = robot.datum_R.T
        slow = np.linalg.cholesky(params.gps_slow * reading.covariance + 1e-12 * np.eye(3))
        H = np.zeros((3, core()))
        H[:, POSE] = np.hstack([back, -back @ se3.cross(at)])
        H[:, DATUM] = -H[:, YAW]
        H[:, SLOW.rows], H[:, JUMP.rows] = slow, np.eye(3)
        errors = slow @ robot[SLOW] + robot[JUMP]
        residual = reading.values - back @ (at - robot.datum_p) - errors
        return Expected(residual, H, (1 - params.gps_slow) * reading.covariance)

    def give_way(self, belief: Belief, residual: Floats, params: GpsErrorParams) -> str:
        """Make both the robot's pose and GPS uncertain.

        If landmarks confirm the pose, the map's place on the Earth is uncertain instead.
        GPS is believed the more, the longer it stays with what it says.
        """
        robot, metres2 = belief.state.robot, float(residual @ residual)
        belief.state = belief.state.copy()
        belief.state.inflate(JUMP.rows, metres2 * np.eye(3))
        earth: EarthFrame = belief.memory[self.name]
        belief.remember(self.name, earth._replace(jump_m=math.sqrt(metres2)))
        shifts = _LIKELIER * metres2 * np.diag([1.0, 1, 1, 0])
        if belief.tags_ns > belief.refusals[self.name].since_ns:
            if belief.map.rules.mode is not MapMode.BUILD and params.origin:
                return "the landmarks confirm the estimate; check gps_origin"
            belief.state.inflate(DATUM, shifts)
            return "the map's position on the Earth is now uncertain"
        shifts[3, 3] = _ASTRAY_RAD**2
        change = se3.about_origin(robot.p)[:, YAW]
        belief.state.inflate(POSE, change @ shifts @ change.T)
        return "the robot's position is now uncertain"


SENSOR = GpsModel()

"""Odometry: accumulated motion with accumulated errors, starting at zero in the frame ``odom``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ros_visualise.data import Floats, Header, Odometry, Transforms
from ros_visualise.simulation.attitude import (
    Quat,
    Vector,
    conjugate,
    from_yaw,
    multiply,
    rows,
    xyzw,
    yaw_of,
)
from ros_visualise.simulation.delivery import delivered
from ros_visualise.simulation.frames import ODOM, body_frame, camera_frame
from ros_visualise.simulation.model import BASE
from ros_visualise.simulation.noise import Episodes, GaussMarkov, Interval, random_of
from ros_visualise.simulation.sensors import Fitting, Measure, SensorType, setting

_SURE = 1e-6  # of exact quantities: filters cannot use a variance of zero
_SLIP = 1e-3  # (m/s)^2, sideways and up, which wheels do not measure
_WHEELS_TWIST = np.diag((_SURE, _SLIP, _SLIP, _SURE, _SURE, _SURE))
_SEEN_TWIST = _SURE * np.eye(6)

_odometry_setting = partial(setting, group="odometry")


@delivered("odom", "odometry")
@dataclass(frozen=True)
class OdometryParams:
    """Parameters of any odometry."""

    odom_rate: float = _odometry_setting(50.0, "messages per second", min=1, max=200)
    odom_scale: float = _odometry_setting(
        0.01,
        "constant scale error of all distances (standard deviation), as a fraction: 0.01 is 1%",
        min=0,
        max=0.5,
    )
    odom_noise: float = _odometry_setting(
        0.01, "position error, growing with the distance, m/sqrt(m)", min=0, max=1
    )
    odom_scale_drift: float = _odometry_setting(
        0.0,
        "slowly varying scale error of distances (standard deviation), as a fraction",
        min=0,
        max=0.5,
    )
    odom_scale_drift_time: float = _odometry_setting(
        20.0, "time constant of the varying scale error, seconds", min=0.1, max=1e4
    )
    odom_stall_every: float = _odometry_setting(
        0.0,
        "mean time between stalls, in which no motion is measured, seconds; 0: no stalls",
        min=0,
        max=1e5,
    )
    odom_stall_for: float = _odometry_setting(
        0.6, "mean duration of a stall, seconds", min=0.01, max=60
    )


class _Failures:
    """A scale of distances that changes, and stalls, of any odometry.

    The covariance knows of the changing scale, but of no stalls.
    """

    def __init__(self, params: OdometryParams, seed: int) -> None:
        p, self._interval = params, Interval()
        self.deviation, self._time_s = p.odom_scale_drift, p.odom_scale_drift_time
        self._drift = GaussMarkov(
            random_of(seed, "odometry_scale"), np.array([self.deviation]), self._time_s
        )
        random = random_of(seed, "odometry_stalls")
        self._stalls = Episodes(random, p.odom_stall_every, p.odom_stall_for)

    def at(self, stamp_ns: int) -> tuple[float, float, bool]:
        """Error of the scale, its correlation with the last one, and True during a stall."""
        keep = math.exp(-self._interval.until(stamp_ns) / self._time_s)
        return float(self._drift.at(stamp_ns)[0]), keep, self._stalls.active(stamp_ns)


@dataclass(frozen=True)
class WheelOdometryParams(OdometryParams):
    """Parameters of wheel odometry."""

    odom_turn_scale: float = _odometry_setting(
        0.02,
        "constant scale error of all rotations (standard deviation), as a fraction: 0.01 is 1%",
        min=0,
        max=0.5,
    )
    odom_turn_noise: float = _odometry_setting(
        0.01, "heading error, growing with rotation, rad/sqrt(rad)", min=0, max=1
    )


class WheelOdometry:
    """Distance and rotation by wheels, each with a constant scale error and a random walk.

    Slip is not added: the wheels' rotation comes from the physics, where they slip. The covariances
    are those of these errors, propagated to first order.

    Source: Thrun, Burgard and Fox, Probabilistic Robotics, 2005, section 5.4; for the covariance
    with the scales as states, Martinelli et al., Simultaneous localization and odometry self
    calibration, 2007.
    """

    def __init__(self, params: WheelOdometryParams, seed: int) -> None:
        self._random = random_of(seed, "odometry")
        way, turn = self._random.standard_normal(2).tolist()
        self._scales = 1 + params.odom_scale * way, 1 + params.odom_turn_scale * turn
        self._params = params
        self._interval, self._period_s = Interval(), 1 / params.odom_rate
        self._x = self._y = self._yaw = 0.0
        scales = params.odom_scale**2, params.odom_turn_scale**2, params.odom_scale_drift**2
        self._failures = _Failures(params, seed)
        # of pose and scales, the last of which changes
        self._covariance = np.diag((0, 0, _SURE, _SURE, _SURE, 0, *scales))
        self._J, self._G = np.eye(9), np.zeros((9, 2))
        self._G[5, 1] = 1

    def advance(self, stamp_ns: int, way_m: float, turn_rad: float) -> Odometry:
        """Estimated pose after moving and rotating by that much."""
        p, period_s = self._params, self._interval.until(stamp_ns) or self._period_s
        noise = self._random.standard_normal(2).tolist()
        drift, keep, stalls = self._failures.at(stamp_ns)
        if stalls:
            way_m = turn_rad = 0.0
        ds = way_m * (self._scales[0] + drift) + p.odom_noise * math.sqrt(abs(way_m)) * noise[0]
        dyaw = turn_rad * self._scales[1] + p.odom_turn_noise * math.sqrt(abs(turn_rad)) * noise[1]
        middle = self._yaw + dyaw / 2
        c, s = math.cos(middle), math.sin(middle)
        self._x += ds * c
        self._y += ds * s
        self._yaw += dyaw
        walks = p.odom_noise**2 * abs(way_m), p.odom_turn_noise**2 * abs(turn_rad)
        self._spread(way_m, turn_rad, (ds * c, ds * s), (c, s), walks)
        self._J[8, 8] = keep
        self._covariance[8, 8] += (1 - keep**2) * p.odom_scale_drift**2
        twist = _WHEELS_TWIST.copy()
        scaled = (p.odom_scale * way_m) ** 2 + (p.odom_scale_drift * way_m) ** 2
        twist[0, 0] += (scaled + walks[0]) / period_s**2
        twist[5, 5] += ((p.odom_turn_scale * turn_rad) ** 2 + walks[1]) / period_s**2
        speed = np.array((ds / period_s, 0.0, 0.0)), np.array((0.0, 0.0, dyaw / period_s))
        pose = np.array((self._x, self._y, 0.0)), xyzw(from_yaw(self._yaw))
        covariances = self._covariance[:6, :6].copy(), twist
        return Odometry(*pose, *speed, *covariances, BASE, Header(stamp_ns, ODOM))

    def _spread(
        self,
        way: float,
        turn: float,
        moved: tuple[float, float],
        ahead: tuple[float, float],
        walks: tuple[float, float],
    ) -> None:
        """Propagate the covariance over a step: ``walks`` are the variances of distance and
        rotation.
        """
        (dx, dy), (c, s) = moved, ahead
        J, G = self._J, self._G
        J[0, 5], J[1, 5] = -dy, dx
        J[0, 6], J[1, 6] = J[0, 8], J[1, 8] = way * c, way * s
        J[0, 7], J[1, 7], J[5, 7] = -dy * turn / 2, dx * turn / 2, turn
        G[0, 0], G[1, 0] = c, s
        G[0, 1], G[1, 1] = -dy / 2, dx / 2
        self._covariance = _carry(self._covariance, J) + _carry(
            np.array(((walks[0], 0), (0, walks[1]))), G
        )


@dataclass(frozen=True)
class VisualOdometryParams(OdometryParams):
    """Parameters of visual-inertial odometry."""

    odom_scale: float = _odometry_setting(
        0.005,
        "constant scale error of all distances (standard deviation), as a fraction: 0.01 is 1%",
        min=0,
        max=0.5,
    )
    odom_noise: float = _odometry_setting(
        0.02, "position error, growing with the distance, m/sqrt(m)", min=0, max=1
    )
    odom_yaw_noise: float = _odometry_setting(
        0.003, "heading error, growing with the distance, rad/sqrt(m)", min=0, max=1
    )


class VisualInertialOdometry:
    """True motion with a constant scale error, and random walks of position and heading.

    Roll and pitch do not drift, as gravity is measured.

    Source: Scaramuzza and Zhang, Visual-inertial odometry of aerial robots, 2019.
    """

    def __init__(
        self, params: VisualOdometryParams, seed: int, start: Vector, attitude: Quat
    ) -> None:
        self._random = random_of(seed, "odometry")
        self._scale = 1 + params.odom_scale * float(self._random.standard_normal())
        self._params = params
        self._last = start
        self._to_odom = conjugate(from_yaw(yaw_of(attitude)))
        self._turn = 0.0  # heading error, to the left
        self._at = (0.0, 0.0, 0.0)
        self._failures = _Failures(params, seed)
        # of pose and scales, the last of which changes, and its growth per metre
        scales = params.odom_scale**2, params.odom_scale_drift**2
        self._covariance = np.diag((0, 0, 0, _SURE, _SURE, 0, *scales))
        walk = params.odom_noise**2
        self._walks = np.diag((walk, walk, walk, 0, 0, params.odom_yaw_noise**2, 0, 0))
        self._J = np.eye(8)

    def advance(
        self, stamp_ns: int, position: Vector, attitude: Quat, linear: Floats, angular: Floats
    ) -> Odometry:
        """Estimated pose; the arguments are true, in ``map``.

        Args:
            linear: (3,) velocity in m/s in the body's axes.
            angular: (3,) angular velocity in rad/s in the body's axes.
        """
        p = self._params
        step = tuple(now - before for now, before in zip(position, self._last, strict=True))
        way = math.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
        self._last = position
        drift, keep, stalls = self._failures.at(stamp_ns)
        if stalls:
            step, way, linear = (0.0, 0.0, 0.0), 0.0, np.zeros(3)
        noise = self._random.standard_normal(4).tolist()
        root = math.sqrt(way)
        turn = multiply(from_yaw(self._turn), self._to_odom)
        seen = [row[0] * step[0] + row[1] * step[1] + row[2] * step[2] for row in rows(turn)]
        scale = self._scale + drift
        moved = [scale * s + p.odom_noise * root * n for s, n in zip(seen, noise, strict=False)]
        self._spread(seen, way, scale)
        self._J[7, 7] = keep
        self._covariance[7, 7] += (1 - keep**2) * p.odom_scale_drift**2
        self._at = self._at[0] + moved[0], self._at[1] + moved[1], self._at[2] + moved[2]
        self._turn += p.odom_yaw_noise * root * noise[3]
        believed = multiply(from_yaw(self._turn), multiply(self._to_odom, attitude))
        vx, vy, vz = linear.tolist()
        velocity = np.array((vx, vy, vz, 0, 0, 0))
        variance = p.odom_scale**2 + p.odom_scale_drift**2
        twist = _SEEN_TWIST + variance * np.multiply.outer(velocity, velocity)
        pose, speed = (np.array(self._at), xyzw(believed)), (linear * scale, angular)
        covariances = self._covariance[:6, :6].copy(), twist
        return Odometry(*pose, *speed, *covariances, BASE, Header(stamp_ns, ODOM))

    def _spread(self, seen: list[float], way: float, scale: float) -> None:
        """Propagate the covariance over a measured step with a given true length."""
        J, (dx, dy, dz) = self._J, seen
        J[0, 5], J[1, 5] = -dy * scale, dx * scale
        for state in (6, 7):
            J[0, state], J[1, state], J[2, state] = dx, dy, dz
        self._covariance = _carry(self._covariance, J) + way * self._walks


def _carry(covariance: Floats, J: Floats) -> Floats:
    """The covariance after a step; ``dot`` takes a third of the time that ``@`` takes."""
    carried: Floats = J.dot(covariance).dot(J.T)
    return carried


def fit(fitting: Fitting) -> Measure:
    """The robot's own odometry, and the frames that it moves."""
    robot, mount = fitting.robot, fitting.mount

    def measure(stamp_ns: int, _: int) -> Mapping[str, Any]:
        odometry = robot.measure_odometry(stamp_ns)
        moving = [body_frame(odometry)]
        if mount.moves:
            mount.advance(stamp_ns, robot.body.attitude)
            moving.append(camera_frame(stamp_ns, mount))
        return {"tf": Transforms(tuple(moving)), "odom": odometry}

    return measure


SENSOR = SensorType(
    OdometryParams, {"odom": Odometry}, "odom_rate", fit, always=True, delivery="odom"
)

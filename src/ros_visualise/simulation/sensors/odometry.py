"""Odometry: motion added up, whose errors add up too. It starts at zero in the frame ``odom``."""

from __future__ import annotations

import math

import numpy as np

from ros_visualise.data import Floats, Header, Odometry
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
from ros_visualise.simulation.sensors.noise import random_of
from ros_visualise.simulation.settings import HuskyParams, QuadrotorParams

_FRAME, _CHILD = "odom", "base_link"


class WheelOdometry:
    """The wheels' way and turn, each with an error of its scale and one that grows as a walk.

    Slip is not drawn: the wheels' turns come out of the physics, where they slip.

    Source: Thrun, Burgard and Fox, Probabilistic Robotics, 2005, section 5.4.
    """

    def __init__(self, params: HuskyParams, seed: int) -> None:
        self._random = random_of(seed, "odometry")
        way, turn = self._random.standard_normal(2).tolist()
        self._scales = 1 + params.odom_scale * way, 1 + params.odom_turn_scale * turn
        self._params = params
        self._x = self._y = self._yaw = 0.0
        self._way_m = self._turned_rad = 0.0

    def advance(self, stamp_ns: int, way_m: float, turn_rad: float, period_s: float) -> Odometry:
        """Where the wheels believe to be after going that far and turning that much."""
        p = self._params
        noise = self._random.standard_normal(2).tolist()
        self._way_m += abs(way_m)
        self._turned_rad += abs(turn_rad)
        ds = way_m * self._scales[0] + p.odom_noise * math.sqrt(abs(way_m)) * noise[0]
        dyaw = turn_rad * self._scales[1] + p.odom_turn_noise * math.sqrt(abs(turn_rad)) * noise[1]
        middle = self._yaw + dyaw / 2
        self._x += ds * math.cos(middle)
        self._y += ds * math.sin(middle)
        self._yaw += dyaw
        return _odometry(
            stamp_ns,
            (self._x, self._y, 0.0),
            from_yaw(self._yaw),
            np.array((ds / period_s, 0.0, 0.0)),
            np.array((0.0, 0.0, dyaw / period_s)),
            self._variances(),
        )

    def _variances(self) -> tuple[float, float, float]:
        p, way, turned = self._params, self._way_m, self._turned_rad
        yaw = (p.odom_turn_scale * turned) ** 2 + p.odom_turn_noise**2 * turned
        along = (p.odom_scale * way) ** 2 + p.odom_noise**2 * way
        return along + yaw * way**2 / 3, 1e-6, yaw


class VisualInertialOdometry:
    """True motion with an error of its scale, and walks of place and heading along the way.

    Roll and pitch do not drift: gravity shows them.

    Source: Scaramuzza and Zhang, Visual-inertial odometry of aerial robots, 2019.
    """

    def __init__(self, params: QuadrotorParams, seed: int, start: Vector, attitude: Quat) -> None:
        self._random = random_of(seed, "odometry")
        self._scale = 1 + params.odom_scale * float(self._random.standard_normal())
        self._params = params
        self._last = start
        self._to_odom = conjugate(from_yaw(yaw_of(attitude)))
        self._turn = 0.0  # by how much it believes to head too far to the left
        self._at = (0.0, 0.0, 0.0)
        self._way_m = 0.0

    def advance(
        self, stamp_ns: int, position: Vector, attitude: Quat, linear: Floats, angular: Floats
    ) -> Odometry:
        """Where it believes to be; the place and attitude are true, in ``map``.

        Args:
            linear: (3,) true velocity in m/s in the body's axes.
            angular: (3,) true turn rates in rad/s in the body's axes.
        """
        p = self._params
        step = tuple(now - before for now, before in zip(position, self._last, strict=True))
        way = math.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
        self._last, self._way_m = position, self._way_m + way
        noise = self._random.standard_normal(4).tolist()
        root = math.sqrt(way)
        turn = multiply(from_yaw(self._turn), self._to_odom)
        seen = (row[0] * step[0] + row[1] * step[1] + row[2] * step[2] for row in rows(turn))
        moved = [
            self._scale * s + p.odom_noise * root * n for s, n in zip(seen, noise, strict=False)
        ]
        self._at = self._at[0] + moved[0], self._at[1] + moved[1], self._at[2] + moved[2]
        self._turn += p.odom_yaw_noise * root * noise[3]
        believed = multiply(from_yaw(self._turn), multiply(self._to_odom, attitude))
        return _odometry(
            stamp_ns, self._at, believed, linear * self._scale, angular, self._variances()
        )

    def _variances(self) -> tuple[float, float, float]:
        p, way = self._params, self._way_m
        yaw = p.odom_yaw_noise**2 * way
        along = (p.odom_scale * way) ** 2 + p.odom_noise**2 * way
        return along + yaw * way**2 / 3, along, yaw


def _odometry(
    stamp_ns: int,
    position: Vector,
    attitude: Quat,
    linear: Floats,
    angular: Floats,
    variances: tuple[float, float, float],
) -> Odometry:
    level, height, yaw = variances
    covariance = np.zeros(36)
    covariance[::7] = level, level, height, 1e-6, 1e-6, yaw
    return Odometry(
        np.array(position),
        xyzw(attitude),
        linear,
        angular,
        covariance.reshape(6, 6),
        _TWIST,
        _CHILD,
        Header(stamp_ns, _FRAME),
    )


_TWIST = np.diag([1e-3, 1e-3, 1e-3, 1e-4, 1e-4, 1e-4])

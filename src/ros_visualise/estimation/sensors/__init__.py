"""Sensors that correct the robot, such as GPS: a file each, with its message, parameters and model.

A sensor's file says what it expects of a robot, and derives that by the robot's errors; one test
holds all derivatives against numerical ones. Another package adds a sensor by an entry point of the
group ``ros_visualise.measurements``; see `ros_visualise.core.registry`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ros_visualise.core.registry import Registry, holding
from ros_visualise.data import Floats
from ros_visualise.estimation.gates import Innovation
from ros_visualise.estimation.imu import Mounting
from ros_visualise.estimation.robot import OwnStates, RobotState, core

if TYPE_CHECKING:
    from ros_visualise.estimation.belief import Belief
    from ros_visualise.estimation.state import State

PATIENCE_S = 3.0
"""Seconds of refused measurements before the estimate gives way."""

_ENOUGH = 4  # refused measurements in a row


class Reading(NamedTuple):
    """A measurement (k,) of a sensor, its covariance (k, k), and where the sensor is mounted."""

    sensor: str
    stamp_ns: int
    values: Floats
    covariance: Floats
    mounting: Mounting


class Expected(NamedTuple):
    """A measurement of k numbers, to first order.

    Attributes:
        residual: (k,) measured minus expected.
        H: (k, n) derivative of the expected by the robot's errors.
        noise: (k, k) covariance.
    """

    residual: Floats
    H: Floats
    noise: Floats


@dataclass(frozen=True)
class Prior:
    """Prior knowledge about a sensor's own states.

    Attributes:
        sigma: standard deviation in the beginning.
        walk: growth of that, per sqrt(s).
        time_s: time constant with which they return to zero, and to ``sigma``; None: never.
    """

    sigma: float
    walk: float = 0.0
    time_s: float | None = None

    def over(self, seconds: float) -> tuple[float, float]:
        """Factor on the states, and variance added, over some time.

        Source: A. Gelb, Applied Optimal Estimation, 1974, section 2.4 (Gauss-Markov processes).
        """
        if self.time_s is None:
            return 1.0, self.walk**2 * seconds
        keep = math.exp(-seconds / self.time_s)
        return keep, (1 - keep**2) * self.sigma**2


class Sensor(ABC):
    """One type of sensor.

    Attributes:
        name: its input of the node, and its part of diagnostics.
        message: type of its messages.
        params: its parameters, fields of the node's own.
        topic: its usual topic.
        needs_imu: True if it only corrects a robot that an IMU propagates.
    """

    name: str
    message: type
    params: type
    topic: str
    needs_imu = False

    @abstractmethod
    def read(self, message: Any, params: Any) -> tuple[Floats, Floats] | str:
        """A message's values (k,) and covariance (k, k); or the reason why it is useless."""

    @abstractmethod
    def expect(self, robot: RobotState, reading: Reading, params: Any) -> Expected | None:
        """A reading compared with a robot; None if it says nothing of this one."""

    @abstractmethod
    def give_way(self, belief: Belief, residual: Floats, params: Any) -> str:
        """Make the estimate so uncertain that refused measurements fit; say what was done."""

    def states(self, params: Any) -> Mapping[OwnStates, Prior]:
        """States of its own."""
        return {}

    def is_of_another(self, belief: Belief, reading: Reading, params: Any) -> bool:
        """True if a reading measures something that is known, and not what `expect` expects."""
        return False

    def fit(self, state: State, reading: Reading, params: Any) -> Innovation | None:
        """Compare a reading with a state; None if it says nothing of it."""
        expected = self.expect(state.robot, reading, params)
        return None if expected is None else _innovation(expected, state)

    def apply(self, belief: Belief, reading: Reading, params: Any) -> None:
        """Correct a belief; what is refused for long raises its uncertainty first."""
        expected = self.expect(belief.state.robot, reading, params)
        if expected is None or self.is_of_another(belief, reading, params):
            belief.counts[f"{self.name} unused"] += 1
            return
        residual, H, noise = expected
        if _innovation(expected, belief.state).is_inlier:
            belief.state = belief.state.corrected(np.arange(core()), H, residual, noise)
            belief.accept(self.name)
            return
        refusal = belief.refuse(self.name)
        refused_s = (belief.now_ns - refusal.since_ns) / 1e9
        if refused_s >= PATIENCE_S and refusal.count >= _ENOUGH:
            done = self.give_way(belief, residual, params)
            belief.note(f"{self.name} has contradicted the estimate for {refused_s:.0f} s: {done}")
            belief.forgive(self.name)


def _innovation(expected: Expected, state: State) -> Innovation:
    H = expected.H
    spread = H @ state.P[: core(), : core()] @ H.T + expected.noise
    return Innovation.of(expected.residual, spread, expected.noise)


SENSORS: Registry[Sensor] = Registry(
    "measurements",
    __name__,
    holding(Sensor, "SENSOR"),  # type: ignore[type-abstract]
    first=("gps", "rangefinder", "barometer", "magnetometer", "optical_flow", "wheel_speed"),
)
"""All sensors, by name."""

"""Delivery of measurements: late, by another clock, or not at all.

A message is stamped by the clock of its sensor, and arrives after its latency. All times here are
those of the simulation, the clock of the ground truth and of the robot's own computer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from ros_visualise.messages.restamped import restamped
from ros_visualise.simulation.noise import random_of
from ros_visualise.simulation.sensors import SensorType, setting

P = TypeVar("P")

_FIELDS = {
    "latency": ("delay of each message, seconds", 0, 5),
    "jitter": ("mean of an additional random delay (exponential), seconds", 0, 5),
    "dropped": ("share of messages that are lost, 0 to 1", 0, 1),
    "clock_offset": (
        "error of the sensor's clock at the start, seconds; positive: late stamps",
        -10,
        10,
    ),
    "clock_drift": ("drift of the sensor's clock, microseconds per second", -1e5, 1e5),
}
"""End of a parameter's name -> its help and its limits; the default is 0."""


def delivered(name: str, group: str) -> Callable[[type[P]], type[P]]:
    """Add the parameters of delivery to those of a sensor.

    Args:
        name: their names begin with it, such as ``gps`` for ``gps_latency``; the sensor's
            ``delivery``.
        group: folder on the page.
    """

    def extend(params: type[P]) -> type[P]:
        content: dict[str, Any] = {"__doc__": params.__doc__, "__module__": params.__module__}
        content["__annotations__"] = {f"{name}_{end}": "float" for end in _FIELDS}
        for end, (help, low, high) in _FIELDS.items():
            content[f"{name}_{end}"] = setting(0.0, help, min=low, max=high, group=group)
        return dataclass(frozen=True)(type(params.__name__, (params,), content))

    return extend


class Delivery:
    """Stamps and delays the messages of one sensor; it keeps their order.

    Args:
        sensor: its type.
        settings: of the robot.
        seed: of the jitter and the losses.
    """

    def __init__(self, sensor: SensorType, settings: Any, seed: int) -> None:
        name = sensor.delivery
        values = [getattr(settings, f"{name}_{end}") if name else 0.0 for end in _FIELDS]
        self._latency_s, self._jitter_s, self._dropped, self._offset_s, drift = values
        self._drift = drift * 1e-6
        self._random = random_of(seed, f"{name}_delivery")
        self._last_ns = 0
        self.is_direct = not any(values)

    def arrival(self, time_ns: int) -> int | None:
        """The time at which messages measured at a time arrive; None if they are lost."""
        jitter, loss = self._random.exponential(), self._random.random()
        if loss < self._dropped:
            return None
        delay_ns = round(1e9 * (self._latency_s + self._jitter_s * jitter))
        self._last_ns = max(self._last_ns, time_ns + delay_ns)
        return self._last_ns

    def stamped(self, message: Any, time_ns: int) -> Any:
        """A message measured at a time, stamped by the sensor's clock."""
        error_ns = round(1e9 * self._offset_s + self._drift * time_ns)
        return restamped(message, max(error_ns, -time_ns))  # no stamp before the start


def longest_delay_s(sensors: list[SensorType], settings: Any) -> float:
    """The longest usual delay of the sensors' messages."""
    names = [sensor.delivery for sensor in sensors if sensor.delivery]
    delays = (
        getattr(settings, f"{n}_latency") + 3 * getattr(settings, f"{n}_jitter") for n in names
    )
    return max(delays, default=0.0)

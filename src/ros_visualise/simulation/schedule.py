"""Schedule of the sensors: which ones measure at which step."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from ros_visualise.simulation.sensors import Fitting, Measure, sensors_of


class SensorStream:
    """Measurements at a rate: each at the first step at or after its due time."""

    def __init__(self, rate_hz: float, measure: Measure, output: str, always: bool) -> None:
        self._rate_hz, self.measure, self.output, self.always = rate_hz, measure, output, always
        self.index = 0
        self.due_ns = 0

    def pass_on(self) -> int:
        """Set the next due time; returns the index of the measurement due now."""
        index = self.index
        self.index += 1
        self.due_ns = round(self.index * 1e9 / self._rate_hz)
        return index


def streams_of(fitting: Fitting) -> list[SensorStream]:
    """The enabled sensors, in the order of equal stamps."""
    settings = fitting.settings
    return [
        SensorStream(
            getattr(settings, one.rate), one.fit(fitting), next(iter(one.outputs)), one.always
        )
        for one in sensors_of(settings)
    ]


class SensorOutput(NamedTuple):
    """A message of the simulation."""

    stamp_ns: int
    name: str
    message: Any


class Schedule:
    """Selects the measurements of each step.

    Args:
        wants: True if an output has listeners. Sensors with a state, such as odometry and biases,
            measure anyway, so that the data does not depend on listeners.
    """

    def __init__(self, streams: list[SensorStream], wants: Callable[[str], bool]) -> None:
        self._streams, self._wants = streams, wants
        self.due_ns = 0

    def take(self, stamp_ns: int) -> Iterator[SensorOutput]:
        """The messages of all measurements due at that time."""
        for stream in self._streams:
            if stream.due_ns > stamp_ns:
                continue
            index = stream.pass_on()
            if stream.always or self._wants(stream.output):
                for name, message in stream.measure(stamp_ns, index).items():
                    yield SensorOutput(stamp_ns, name, message)
        self.due_ns = min(stream.due_ns for stream in self._streams)

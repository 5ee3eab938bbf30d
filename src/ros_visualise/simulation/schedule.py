"""Schedule of the sensors: which ones measure at which step."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from heapq import heappop, heappush
from itertools import count
from typing import Any, NamedTuple

from ros_visualise.simulation.delivery import Delivery
from ros_visualise.simulation.sensors import Fitting, SensorType, sensors_of


class SensorStream:
    """Measurements at a rate: each at the first step at or after its due time."""

    def __init__(self, sensor: SensorType, fitting: Fitting) -> None:
        self._rate_hz = float(getattr(fitting.settings, sensor.rate))
        self.measure, self.always = sensor.fit(fitting), sensor.always
        self.output = next(iter(sensor.outputs))
        self.delivery = Delivery(sensor, fitting.settings, fitting.seed)
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
    return [SensorStream(sensor, fitting) for sensor in sensors_of(fitting.settings)]


class SensorOutput(NamedTuple):
    """A message of the simulation, and the time at which it arrives."""

    time_ns: int
    name: str
    message: Any


class Schedule:
    """Selects the measurements of each step, and delivers their messages.

    Args:
        wants: True if an output has listeners. Sensors with a state, such as odometry and biases,
            measure anyway, so that the data does not depend on listeners.
    """

    def __init__(self, streams: list[SensorStream], wants: Callable[[str], bool]) -> None:
        self._streams, self._wants = streams, wants
        self._on_the_way: list[tuple[int, int, SensorOutput]] = []
        self._order = count()
        self.due_ns = 0

    def take(self, time_ns: int) -> Iterator[SensorOutput]:
        """The messages that arrive at that time, of measurements due by then."""
        for stream in self._streams:
            if stream.due_ns <= time_ns:
                yield from self._measure(stream, time_ns)
        while self._on_the_way and self._on_the_way[0][0] <= time_ns:
            yield heappop(self._on_the_way)[2]._replace(time_ns=time_ns)
        self.due_ns = min(stream.due_ns for stream in self._streams)
        if self._on_the_way:
            self.due_ns = min(self.due_ns, self._on_the_way[0][0])

    def _measure(self, stream: SensorStream, time_ns: int) -> Iterator[SensorOutput]:
        """The messages of a measurement, unless they are delayed or lost."""
        index, delivery = stream.pass_on(), stream.delivery
        if delivery.is_direct:
            arrival_ns: int | None = time_ns
        else:
            arrival_ns = delivery.arrival(time_ns)
        if not stream.always and (arrival_ns is None or not self._wants(stream.output)):
            return
        for name, message in stream.measure(time_ns, index).items():
            if delivery.is_direct:
                yield SensorOutput(time_ns, name, message)
            elif arrival_ns is not None:
                output = SensorOutput(arrival_ns, name, delivery.stamped(message, time_ns))
                heappush(self._on_the_way, (arrival_ns, next(self._order), output))

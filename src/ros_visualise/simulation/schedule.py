"""When which sensor measures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

Make = Callable[[int, int], Iterable[tuple[str, Any]]]
"""(stamp_ns, number of the measurement) -> (output, message) of one measurement."""


class Stream:
    """Something that happens at a rate: at the first step at or after each due time."""

    def __init__(self, rate_hz: float, make: Make, output: str, always: bool) -> None:
        self._rate_hz, self.make, self.output, self.always = rate_hz, make, output, always
        self.index = 0
        self.due_ns = 0

    def pass_on(self) -> int:
        """Go on to the next due time; returns the number of the measurement that is due now."""
        index = self.index
        self.index += 1
        self.due_ns = round(self.index * 1e9 / self._rate_hz)
        return index


class Output(NamedTuple):
    """A message of the simulation."""

    stamp_ns: int
    name: str
    message: Any


class Schedule:
    """The streams, asked at each step.

    Args:
        wants: whether anybody wants that output. Streams that add up (odometry) or wander (biases)
            measure all the same, so that what is wanted changes no data.
    """

    def __init__(self, streams: list[Stream], wants: Callable[[str], bool]) -> None:
        self._streams, self._wants = streams, wants
        self.due_ns = 0

    def take(self, stamp_ns: int) -> Iterator[Output]:
        """What is measured at that time."""
        for stream in self._streams:
            if stream.due_ns > stamp_ns:
                continue
            index = stream.pass_on()
            if stream.always or self._wants(stream.output):
                for name, message in stream.make(stamp_ns, index):
                    yield Output(stamp_ns, name, message)
        self.due_ns = min(stream.due_ns for stream in self._streams)

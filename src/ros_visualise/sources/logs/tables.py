"""Tables of numbers, as flight logs hold them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.sources.recordings import Loss

_FAR_US = 10_000_000
_FAR_PERIODS = 100  # of a log that has little in it
_NEVER_US = 2**52  # 142 years after the start

Column = npt.NDArray[Any]
_Times = npt.NDArray[np.int64]
_Mask = npt.NDArray[np.bool_]


class LogTable:
    """The samples of one topic of a log, by field.

    Args:
        time: the field that holds the time, microseconds.

    Attributes:
        name: name of the topic, such as ``vehicle_attitude``.
        times_us: (N,) int64, ascending, microseconds since the controller was started.
    """

    def __init__(self, name: str, columns: Mapping[str, Column], time: str = "timestamp") -> None:
        times = columns[time]
        is_sorted = bool((times[:-1] <= times[1:]).all())
        order = slice(None) if is_sorted else np.argsort(times, kind="stable")
        self.name, self._time = name, time
        self.raw = {field: values[order] for field, values in columns.items()}
        """(N,) logged values by field."""
        self.times_us = self.raw[time].astype(np.int64)

    def __len__(self) -> int:
        return len(self.times_us)

    def offset_us(self, times_us: Column, known: _Mask) -> int | None:
        """Another clock minus this one, by its times (N,) where they are known; None: nowhere.

        It is the median, as the latency of what knows the other clock varies.
        """
        return int(np.median((times_us - self.times_us)[known])) if known.any() else None

    def has(self, *fields: str) -> bool:
        """True if it has all of these fields."""
        return self.raw.keys() >= {*fields}

    def within(self, start_us: int, end_us: int) -> LogTable:
        """The same table over this time; samples from outside of it are moved to its ends.

        PX4 begins a log with the last message of each topic, however long ago that was, and a few
        have an implausible time. Their own field ``timestamp`` stays unchanged.
        """
        table = LogTable(self.name, self.raw, self._time)
        table.times_us = np.clip(self.times_us, start_us, end_us)
        return table

    def column(self, field: str, default: float = 0.0) -> Floats:
        """(N,) values of a field; of one that this version of PX4 does not log, the default."""
        if field not in self.raw:
            return np.full(len(self), default)
        return self.raw[field].astype(np.float64)

    def columns(self, *fields: str) -> Floats:
        """(N, number of fields)."""
        return np.stack([self.column(field) for field in fields], axis=1)

    def vector(self, field: str, size: int) -> Floats:
        """(N, size) of an array."""
        return self.columns(*(f"{field}[{number}]" for number in range(size)))

    def where(self, mask: _Mask) -> LogTable:
        """The samples that a mask (N,) chooses."""
        chosen = {name: values[mask] for name, values in self.raw.items()}
        return LogTable(self.name, chosen, self._time)


def without_strays(columns: Mapping[str, Mapping[str, Column]], loss: Loss) -> dict[str, LogTable]:
    """Tables without the samples that have impossible times, which are counted as lost."""
    strays = find_strays({name: one["timestamp"] for name, one in columns.items()})
    if count := sum(int(mask.sum()) for mask in strays.values()):
        samples = "sample" if count == 1 else "samples"
        loss.add(f"{count} {samples} skipped: implausible timestamps", count)
    return {
        name: LogTable(name, {field: values[~mask] for field, values in columns[name].items()})
        for name, mask in strays.items()
        if not mask.all()
    }


def find_strays(times_us: Mapping[str, npt.NDArray[np.uint64]]) -> dict[str, _Mask]:
    """Find samples with impossible times, as from a single wrong bit.

    Either they lie out of order within their own topic, or no other sample of any topic is near.

    Args:
        times_us: topic -> (N,) times in the order of the file.

    Returns:
        topic -> (N,) true for strays.
    """
    signed = {name: np.minimum(t, _NEVER_US).astype(np.int64) for name, t in times_us.items()}
    every = np.sort(np.concatenate([np.zeros(0, np.int64), *signed.values()]))
    every = every[every < _NEVER_US]
    if len(every) < 3:  # too few to see which is right
        return {name: times == _NEVER_US for name, times in signed.items()}
    far_us = max(_FAR_US, _FAR_PERIODS * int(np.median(np.diff(every))))
    steps = np.concatenate([[far_us + 1], np.diff(every), [far_us + 1]])
    lonely = every[(steps[:-1] > far_us) & (steps[1:] > far_us)]
    return {
        name: _is_misplaced(times, far_us) | np.isin(times, lonely) | (times == _NEVER_US)
        for name, times in signed.items()
    }


def _is_misplaced(times_us: _Times, far_us: int) -> _Mask:
    """True for each time that stands far off between two that are in order."""
    found = np.zeros(len(times_us), bool)
    before, own, after = times_us[:-2], times_us[1:-1], times_us[2:]
    is_beyond = (own > after + far_us) | (own < before - far_us)
    found[1:-1] = is_beyond & (before <= after)
    return found

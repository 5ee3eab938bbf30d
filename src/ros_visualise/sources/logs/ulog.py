"""PX4's ULog files as columns of numbers."""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import OpenError, TooLarge
from ros_visualise.core.limits import check_log
from ros_visualise.core.regular_files import read_file
from ros_visualise.data import Floats
from ros_visualise.sources.logs.ulog_records import (
    MAGIC,
    Format,
    Records,
    Topic,
    UnknownFlags,
    columns,
)
from ros_visualise.sources.recordings import Loss

log = logging.getLogger(__name__)

_AGAIN = "copy it again from the vehicle"


class Table:
    """The samples of one topic of PX4's, by field.

    Attributes:
        name: as ``vehicle_attitude``.
        times_us: (N,) int64, ascending, microseconds since the controller was started.
    """

    def __init__(self, name: str, columns: Mapping[str, npt.NDArray[Any]]) -> None:
        times = columns["timestamp"]
        order = slice(None) if _is_sorted(times) else np.argsort(times, kind="stable")
        self.name = name
        self._columns = {field: values[order] for field, values in columns.items()}
        self.times_us = self._columns["timestamp"].astype(np.int64)

    def __len__(self) -> int:
        return len(self.times_us)

    def has(self, *fields: str) -> bool:
        """True if it has all of these fields."""
        return all(field in self._columns for field in fields)

    def raw(self, field: str) -> npt.NDArray[Any]:
        """(N,) the values of a field as they were logged.

        Raises:
            KeyError: there is no such field.
        """
        return self._columns[field]

    def within(self, start_us: int, end_us: int) -> Table:
        """The same over this time; samples from outside of it are taken for its start or its end.

        PX4 begins a log with the last message of each topic, however long ago that was, and a few
        have a time that is none of the log's. Their own field ``timestamp`` stays as it is.
        """
        table = Table(self.name, self._columns)
        table.times_us = np.clip(self.times_us, start_us, end_us)
        return table

    def column(self, field: str, default: float = 0.0) -> Floats:
        """(N,) the values of a field; of one that this version of PX4 does not log, the default."""
        if field not in self._columns:
            return np.full(len(self), default)
        return self._columns[field].astype(np.float64)

    def columns(self, *fields: str) -> Floats:
        """(N, number of fields)."""
        return np.stack([self.column(field) for field in fields], axis=1)

    def vector(self, field: str, size: int) -> Floats:
        """(N, size) of an array."""
        return self.columns(*(f"{field}[{number}]" for number in range(size)))

    def where(self, mask: npt.NDArray[np.bool_]) -> Table:
        """The samples that a mask (N,) chooses."""
        return Table(self.name, {name: values[mask] for name, values in self._columns.items()})


@dataclass(frozen=True)
class Log:
    """What a ULog file holds, as far as it can be read.

    Attributes:
        tables: the first instance of each topic that was asked for, without wrong times.
        all: every topic, as ``sensor_gyro``; further instances as ``sensor_gyro_1``.
        formats: the types of PX4's that it describes, by name.
        loss: what could not be read.
    """

    tables: dict[str, Table]
    all: dict[str, Table]
    formats: dict[str, Format]
    loss: Loss


def read_ulog(path: Path, names: Collection[str]) -> Log:
    """Read a file; times that cannot be right are looked for in the topics of these names.

    Raises:
        OpenError: it is no ULog file.
    """
    records = _read(path)
    topics = {_called(one): columns(one.layout, one.samples) for one in records.topics}
    firsts = {name: one for name, one in topics.items() if name in names}
    loss = _loss(records)
    for length_ms in records.dropouts_ms:
        log.info("%s: the vehicle itself recorded nothing for %d ms", path, length_ms)
    tables = _without_strays(firsts, loss)
    called = {_called(one): one.name for one in records.topics}
    every = {name: Table(called[name], one) for name, one in topics.items()}
    return Log(tables, every, records.formats.by_name, loss)


def _called(one: Topic) -> str:
    return f"{one.name}_{one.instance}" if one.instance else one.name


def _is_sorted(times: npt.NDArray[Any]) -> bool:
    return bool((times[:-1] <= times[1:]).all())


def _read(path: Path) -> Records:
    try:
        check_log(path.stat().st_size)
        data = read_file(path)
        if not data.startswith(MAGIC):
            raise OpenError(f"{path}: not a flight log; {_AGAIN}")
        return Records(data)
    except TooLarge as error:
        raise OpenError(f"{path}: {error}") from None
    except UnknownFlags:
        raise OpenError(f"{path}: of a later version of ULog; {_AGAIN}, or update this") from None


def _loss(records: Records) -> Loss:
    loss = Loss(records.strangers, records.damaged + records.cut)
    if records.damaged:
        loss.notes.append(f"{records.damaged} damaged bytes skipped")
    if records.strangers:
        loss.notes.append(f"{records.strangers} samples of topics that it does not describe")
    if records.cut:
        loss.notes.append(
            f"cut off within its last message, of which {records.cut} bytes are there"
        )
    return loss


def _without_strays(columns: Mapping[str, Mapping[str, Any]], loss: Loss) -> dict[str, Table]:
    strays = find_strays({name: values["timestamp"] for name, values in columns.items()})
    count = sum(int(mask.sum()) for mask in strays.values())
    if count:
        loss.messages += count
        times = "a time that cannot be its own" if count == 1 else "times that cannot be their own"
        loss.notes.append(f"{count} {'sample' if count == 1 else 'samples'} left out, with {times}")
    kept = {
        name: {field: column[~strays[name]] for field, column in values.items()}
        for name, values in columns.items()
    }
    return {name: Table(name, values) for name, values in kept.items() if len(values["timestamp"])}


_FAR_US = 10_000_000
_FAR_PERIODS = 100  # of a log that has little in it
_NEVER_US = 2**52  # 142 years after the start

_Times = npt.NDArray[np.int64]
_Mask = npt.NDArray[np.bool_]


def find_strays(times_us: Mapping[str, npt.NDArray[np.uint64]]) -> dict[str, _Mask]:
    """Which samples jump far from those before and after them.

    Either they lie out of order within their own topic, or no other sample of any topic is near.

    Args:
        times_us: topic -> (N,) times in the order of the file.

    Returns:
        topic -> (N,) whether it is a stray.
    """
    signed = {name: np.minimum(t, _NEVER_US).astype(np.int64) for name, t in times_us.items()}
    every = np.sort(np.concatenate([np.zeros(0, np.int64), *signed.values()]))
    every = every[every < _NEVER_US]
    if len(every) < 3:  # too few to tell which is right
        return {name: times == _NEVER_US for name, times in signed.items()}
    far_us = max(_FAR_US, _FAR_PERIODS * int(np.median(np.diff(every))))
    lonely = every[_is_far(every, far_us)]
    return {
        name: _is_misplaced(times, far_us) | np.isin(times, lonely) | (times == _NEVER_US)
        for name, times in signed.items()
    }


def _is_far(ordered_us: _Times, far_us: int) -> _Mask:
    """Whether each time is far from the one before it and the one after it."""
    steps = np.concatenate([[far_us + 1], np.diff(ordered_us), [far_us + 1]])
    is_far: _Mask = (steps[:-1] > far_us) & (steps[1:] > far_us)
    return is_far


def _is_misplaced(times_us: _Times, far_us: int) -> _Mask:
    """Whether each time stands far off between two that are in order."""
    found = np.zeros(len(times_us), bool)
    before, own, after = times_us[:-2], times_us[1:-1], times_us[2:]
    is_beyond = (own > after + far_us) | (own < before - far_us)
    found[1:-1] = is_beyond & (before <= after)
    return found

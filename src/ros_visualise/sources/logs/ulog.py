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
from ros_visualise.sources.logs.ulog_records import MAGIC, Records, UlogFields, UnknownFlags
from ros_visualise.sources.recordings import Loss

log = logging.getLogger(__name__)

_AGAIN = "copy it again from the vehicle"
_FAR_US = 10_000_000
_FAR_PERIODS = 100  # of a log that has little in it
_NEVER_US = 2**52  # 142 years after the start

_Times = npt.NDArray[np.int64]
_Mask = npt.NDArray[np.bool_]


class LogTable:
    """The samples of one PX4 topic, by field.

    Attributes:
        name: name of the topic, such as ``vehicle_attitude``.
        times_us: (N,) int64, ascending, microseconds since the controller was started.
    """

    def __init__(self, name: str, columns: Mapping[str, npt.NDArray[Any]]) -> None:
        times = columns["timestamp"]
        is_sorted = bool((times[:-1] <= times[1:]).all())
        order = slice(None) if is_sorted else np.argsort(times, kind="stable")
        self.name = name
        self.raw = {field: values[order] for field, values in columns.items()}
        """(N,) logged values by field."""
        self.times_us = self.raw["timestamp"].astype(np.int64)

    def __len__(self) -> int:
        return len(self.times_us)

    def has(self, *fields: str) -> bool:
        """True if it has all of these fields."""
        return self.raw.keys() >= {*fields}

    def within(self, start_us: int, end_us: int) -> LogTable:
        """The same table over this time; samples from outside of it are moved to its ends.

        PX4 begins a log with the last message of each topic, however long ago that was, and a few
        have an implausible time. Their own field ``timestamp`` stays unchanged.
        """
        table = LogTable(self.name, self.raw)
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
        return LogTable(self.name, {name: values[mask] for name, values in self.raw.items()})


@dataclass(frozen=True)
class ULog:
    """Content of a ULog file, as far as it can be read.

    Attributes:
        tables: the first instance of each requested topic, without wrong times.
        all: every topic, as ``sensor_gyro``; further instances as ``sensor_gyro_1``.
        formats: PX4's types by name.
        loss: damage.
    """

    tables: dict[str, LogTable]
    all: dict[str, LogTable]
    formats: dict[str, UlogFields]
    loss: Loss


def read_ulog(path: Path, names: Collection[str]) -> ULog:
    """Read a file; topics of these names are searched for implausible times; raises OpenError."""
    records = _read(path)
    for length_ms in records.dropouts_ms:
        log.info("%s: logger dropout: %d ms", path, length_ms)
    topics = {
        f"{one.name}_{one.instance}" if one.instance else one.name: one for one in records.topics
    }
    columns = {name: topics[name].columns for name in names if name in topics}
    strays = find_strays({name: one["timestamp"] for name, one in columns.items()})
    loss = _loss(records)
    if count := sum(int(mask.sum()) for mask in strays.values()):
        loss.messages += count
        samples = "sample" if count == 1 else "samples"
        loss.notes.append(f"{count} {samples} skipped: implausible timestamps")
    tables = {
        name: LogTable(name, {field: values[~mask] for field, values in columns[name].items()})
        for name, mask in strays.items()
        if not mask.all()
    }
    every = {name: LogTable(one.name, one.columns) for name, one in topics.items()}
    return ULog(tables, every, records.formats.by_name, loss)


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
        raise OpenError(
            f"{path}: unsupported version of ULog; {_AGAIN}, or update ros_visualise"
        ) from None


def _loss(records: Records) -> Loss:
    loss = Loss(records.strangers, records.damaged + records.cut)
    if records.damaged:
        loss.notes.append(f"{records.damaged} damaged bytes skipped")
    if records.strangers:
        loss.notes.append(f"{records.strangers} samples of undescribed topics")
    if records.cut:
        loss.notes.append(f"cut off {records.cut} bytes into its last message")
    return loss

"""PX4's ULog files as columns of numbers."""

from __future__ import annotations

import contextlib
import io
import logging
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pyulog import ULog
from pyulog.exceptions import ULogException

from ros_visualise.data import Floats
from ros_visualise.errors import OpenError
from ros_visualise.sources.logs.strays import find_strays
from ros_visualise.sources.recordings import Loss

log = logging.getLogger(__name__)

_HEADER_SIZE = 16

Format = list[tuple[str, int, str]]
"""The fields of a type: what each is of, how many (0: one, no array), and its name."""


class Table:
    """The samples of one topic of PX4's, by field.

    Attributes:
        name: as ``vehicle_attitude``.
        times_us: (N,) int64, ascending, microseconds since the controller was started.
    """

    def __init__(self, name: str, columns: Mapping[str, npt.NDArray[Any]]) -> None:
        order = np.argsort(columns["timestamp"], kind="stable")
        self.name = name
        self._columns = {field: values[order] for field, values in columns.items()}
        self.times_us = self._columns["timestamp"].astype(np.int64)

    def __len__(self) -> int:
        return len(self.times_us)

    def has(self, *fields: str) -> bool:
        """Whether it has all of these fields."""
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
    found = _parse(path)
    there = [one for one in found.data_list if len(one.data["timestamp"])]
    columns = {one.name: one.data for one in there if one.multi_id == 0 and one.name in names}
    loss = Loss()
    if found.file_corruption:
        loss.notes.append("parts are damaged and were left out")
    elif cut := _cut_bytes(path):
        loss.notes.append(f"cut off within its last message, of which {cut} bytes are there")
    for drop in found.dropouts:
        log.info("%s: the vehicle itself recorded nothing for %d ms", path, drop.duration)
    tables = _without_strays(columns, loss)
    return Log(
        tables, {_called(one): Table(one.name, one.data) for one in there}, _formats(found), loss
    )


def _called(one: Any) -> str:
    return f"{one.name}_{one.multi_id}" if one.multi_id else str(one.name)


def _formats(found: ULog) -> dict[str, Format]:
    return {
        name: [field for field in described.fields if not field[2].startswith("_padding")]
        for name, described in found.message_formats.items()
    }


def _parse(path: Path) -> ULog:
    said = io.StringIO()  # the library prints what it finds damaged
    try:
        with contextlib.redirect_stdout(said), path.open("rb") as file:
            return ULog(file)
    except OSError:
        raise
    except ULogException as error:
        raise OpenError(
            f"{path}: cannot be read: {error}; copy it again from the vehicle"
        ) from None
    except Exception as error:  # and raises what it happens to meet in a file that is damaged
        raise OpenError(
            f"{path}: too damaged to be read; copy it again from the vehicle"
        ) from error


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


def _cut_bytes(path: Path) -> int:
    """How much there is of a last message that is not whole: each says its size first."""
    data = np.memmap(path, np.uint8, "r")
    place, end = _HEADER_SIZE, len(data)
    while place + 3 <= end:
        following = place + 3 + int(data[place]) + 256 * int(data[place + 1])
        if following > end:
            break
        place = following
    return end - place

"""PX4's ULog files as columns of numbers."""

from __future__ import annotations

import contextlib
import io
import logging
from collections.abc import Collection, Mapping
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


def read_ulog(path: Path, names: Collection[str]) -> tuple[dict[str, Table], Loss]:
    """The first instance of each of these topics, as far as it can be read, and what was lost.

    Raises:
        OpenError: it is no ULog file.
    """
    found = _parse(path, names)
    columns = {
        one.name: one.data
        for one in found.data_list
        if one.multi_id == 0 and len(one.data["timestamp"])
    }
    loss = Loss()
    if found.file_corruption:
        loss.notes.append("parts are damaged and were left out")
    elif cut := _cut_bytes(path):
        loss.notes.append(f"cut off within its last message, of which {cut} bytes are there")
    for drop in found.dropouts:
        log.info("%s: the vehicle itself recorded nothing for %d ms", path, drop.duration)
    return _without_strays(columns, loss), loss


def _parse(path: Path, names: Collection[str]) -> ULog:
    said = io.StringIO()  # the library prints what it finds damaged
    try:
        with contextlib.redirect_stdout(said), path.open("rb") as file:
            return ULog(file, list(names))
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

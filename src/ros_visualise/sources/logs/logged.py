"""A flight log as a recording: the topics of `flight`, and all that is logged as topics of its own.

Those are below the name of the system, as ``/px4/vehicle_attitude``, ``/px4/sensor_gyro_1``; their
types are as the log describes them, ``px4_msgs/msg/VehicleAttitude``, in its own units and axes.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ros_visualise.core.errors import DamagedMessage, OpenError
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import Recorded, TopicType
from ros_visualise.sources.logs.flight import FlightTopics
from ros_visualise.sources.logs.tables import LogTable
from ros_visualise.sources.recordings import Loss
from ros_visualise.sources.recordings.series import SeriesRecording
from ros_visualise.sources.series import Series

log = logging.getLogger(__name__)

LogFields = list[tuple[str, int, str]]
"""Type, size of the array (0: a single value) and name of each field."""
_TYPES = {"float": "float32", "double": "float64", "char": "uint8"}
_RULE = "=" * 80


@dataclass(frozen=True)
class FlightLog:
    """Content of a flight log, as far as it can be read.

    Attributes:
        system: whose names and types the tables have: ``px4``.
        tables: those that topics are made from, as `FlightTopics` takes them.
        all: every topic, as ``sensor_gyro``; further instances as ``sensor_gyro_1``.
        formats: types by name, those inside others too.
        loss: damage.
        notes: what was skipped, and why.
        utc_us: UTC minus the log's clock, if known.
    """

    system: str
    tables: Mapping[str, LogTable]
    all: Mapping[str, LogTable]
    formats: Mapping[str, LogFields]
    loss: Loss
    notes: tuple[str, ...] = ()
    utc_us: int | None = None


def recorded_flight(path: Path, format: str, found: FlightLog) -> SeriesRecording:
    """A log as a recording; stamps are in UTC where that is known, else since the start.

    Raises:
        OpenError: it holds no positions.
    """
    utc_us = found.utc_us or 0
    made = FlightTopics(found.tables, utc_us)
    if not made.series:
        raise OpenError(f"{path}: contains no attitude, position or fix; log the default topics")
    stamps_us = np.concatenate([one.stamps_ns for one in made.series]) // 1000 - utc_us
    span = int(stamps_us.min()), int(stamps_us.max())
    tables = {name: table.within(*span) for name, table in found.all.items()}
    logged = logged_series(found.system, tables, found.formats, utc_us)
    clock = "time since start" if found.utc_us is None else "UTC"
    series, notes = [*made.series, *logged], [*found.notes, *made.notes]
    size = path.stat().st_size
    return SeriesRecording(path, f"{format} ({clock})", size, series, notes, loss=found.loss)


def logged_series(
    system: str, tables: Mapping[str, LogTable], formats: Mapping[str, LogFields], utc_us: int
) -> Iterator[Series]:
    """A series for each table, below the name of the system; skipped if ROS cannot describe it."""
    types = _LoggedTypes(system, formats)
    for name, table in tables.items():
        try:
            yield types.series(name, table, utc_us)
        except (DamagedMessage, KeyError) as error:
            log.warning("%s skipped: %s", name, error)


class _LoggedTypes:
    """The types of a log, as ROS has them."""

    def __init__(self, system: str, formats: Mapping[str, LogFields]) -> None:
        self._system, self._formats = system, formats
        self._definitions = Definitions("cdr")

    def series(self, name: str, table: LogTable, utc_us: int) -> Series:
        """The messages of a table; raises KeyError, DamagedMessage if they cannot be described."""
        kind, definitions = self._type_name(table.name), self._definitions
        definitions.define(kind, self._define(table.name))
        stamps_ns = (table.times_us + utc_us) * 1000

        def make(index: int) -> Recorded:
            data = definitions.write(kind, self._message(table, table.name, "", index))
            return Recorded(kind, data, definitions, int(stamps_ns[index]))

        ros = TopicType(kind, definitions)
        return Series(f"/{self._system}/{name.lower()}", Recorded, stamps_ns, make, ros=ros)

    def _message(self, table: LogTable, type: str, prefix: str, index: int) -> Any:
        """One message, or one inside another, from the columns whose names begin with a prefix."""
        values = []
        for kind, count, field in self._formats[type]:
            at = f"{prefix}{field}"
            names = [f"{at}[{number}]" for number in range(count)] if count else [at]
            if kind in self._formats:
                found: Any = [self._message(table, kind, f"{one}.", index) for one in names]
            elif kind == "string":
                found = [table.raw[one][index].decode("utf-8", "replace") for one in names]
            else:
                found = np.array([table.raw[one][index] for one in names], _ros(kind))
            values.append(found if count else found[0])
        return self._definitions.types[self._type_name(type)](*values)

    def _type_name(self, name: str) -> str:
        return f"{self._system}_msgs/msg/{_camel(name)}"

    def _define(self, name: str) -> str:
        """The definition of a type and those inside it, in ROS's language."""
        parts = [self._fields(name)]
        for one in dict.fromkeys(self._inner(name)):
            parts.append(f"{_RULE}\nMSG: {self._system}_msgs/{_camel(one)}\n{self._fields(one)}")
        return "\n".join(parts)

    def _inner(self, name: str) -> Iterator[str]:
        for kind, _, _ in self._formats[name]:
            if kind in self._formats:
                yield kind
                yield from self._inner(kind)

    def _fields(self, name: str) -> str:
        lines = []
        for kind, count, field in self._formats[name]:
            own = _camel(kind) if kind in self._formats else _ros(kind)
            lines.append(f"{own}{f'[{count}]' if count else ''} {field}")
        return "\n".join(lines)


def _ros(kind: str) -> str:
    """A basic type as ROS calls it."""
    return _TYPES.get(kind, kind.removesuffix("_t"))


def _camel(name: str) -> str:
    return "".join(part.capitalize() for part in name.split("_"))

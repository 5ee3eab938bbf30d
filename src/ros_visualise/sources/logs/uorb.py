"""All that PX4 logs, as topics of their own: ``/px4/vehicle_attitude``, ``/px4/sensor_gyro_1``.

Their types are those of px4_msgs, as the log describes them: ``px4_msgs/msg/VehicleAttitude``.
Numbers are in PX4's units and axes.

Source: PX4 Developer Guide, ULog File Format; px4_msgs for the names.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import Recorded, TopicType
from ros_visualise.sources.logs.ulog import LogTable
from ros_visualise.sources.logs.ulog_records import UlogFields
from ros_visualise.sources.series import Series

log = logging.getLogger(__name__)

_PACKAGE = "px4_msgs"
_TYPES = {"float": "float32", "double": "float64", "char": "uint8"}
_RULE = "=" * 80


def uorb_series(
    tables: Mapping[str, LogTable], formats: Mapping[str, UlogFields], utc_us: int
) -> Iterator[Series]:
    """A series for each table, by its name; a topic that ROS cannot describe is skipped.

    Args:
        formats: PX4's types by name, those inside others too.
        utc_us: UTC minus the vehicle's clock.
    """
    definitions = Definitions("cdr")
    for name, table in tables.items():
        try:
            definitions.define(type_name(table.name), define(table.name, formats))
        except (DamagedMessage, KeyError) as error:
            log.warning("%s skipped: %s", name, error)
            continue
        yield _series(name, table, formats, definitions, utc_us)


def type_name(name: str) -> str:
    """Type of a topic's ROS messages: ``px4_msgs/msg/VehicleAttitude``."""
    return f"{_PACKAGE}/msg/{_camel(name)}"


def define(name: str, formats: Mapping[str, UlogFields]) -> str:
    """The definition of a type and those inside it, in ROS's language; raises KeyError."""
    inner = dict.fromkeys(_inner(name, formats))
    parts = [_fields(name, formats)]
    parts += [f"{_RULE}\nMSG: {_PACKAGE}/{_camel(one)}\n{_fields(one, formats)}" for one in inner]
    return "\n".join(parts)


def _series(
    name: str,
    table: LogTable,
    formats: Mapping[str, UlogFields],
    definitions: Definitions,
    utc_us: int,
) -> Series:
    stamps_ns = (table.times_us + utc_us) * 1000
    kind = type_name(table.name)

    def make(index: int) -> Recorded:
        message = _message(table, table.name, "", index, formats, definitions)
        return Recorded(kind, definitions.write(kind, message), definitions, int(stamps_ns[index]))

    ros = TopicType(kind, definitions)
    return Series(f"/px4/{name}", Recorded, stamps_ns, make, ros=ros)


def _message(
    table: LogTable,
    type: str,
    prefix: str,
    index: int,
    formats: Mapping[str, UlogFields],
    definitions: Definitions,
) -> Any:
    """One message, or one inside another, from the columns whose names begin with a prefix."""
    values = []
    for kind, count, field in formats[type]:
        names = [f"{prefix}{field}[{n}]" for n in range(count)] if count else [f"{prefix}{field}"]
        if kind in formats:
            found: Any = [
                _message(table, kind, f"{one}.", index, formats, definitions) for one in names
            ]
        else:
            found = np.array([table.raw[one][index] for one in names], _ros(kind))
        values.append(found if count else found[0])
    return definitions.types[type_name(type)](*values)


def _inner(name: str, formats: Mapping[str, UlogFields]) -> Iterator[str]:
    for kind, _, _ in formats[name]:
        if kind in formats:
            yield kind
            yield from _inner(kind, formats)


def _fields(name: str, formats: Mapping[str, UlogFields]) -> str:
    lines = []
    for kind, count, field in formats[name]:
        own = _camel(kind) if kind in formats else _ros(kind)
        lines.append(f"{own}{f'[{count}]' if count else ''} {field}")
    return "\n".join(lines)


def _ros(kind: str) -> str:
    """PX4's basic type as ROS calls it."""
    return _TYPES.get(kind, kind.removesuffix("_t"))


def _camel(name: str) -> str:
    return "".join(part.capitalize() for part in name.split("_"))

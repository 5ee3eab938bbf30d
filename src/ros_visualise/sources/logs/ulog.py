"""PX4's ULog files as columns of numbers."""

from __future__ import annotations

import logging
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from ros_visualise.core.errors import OpenError, TooLarge
from ros_visualise.core.limits import check_log
from ros_visualise.core.regular_files import read_file
from ros_visualise.sources.logs.tables import LogTable, without_strays
from ros_visualise.sources.logs.ulog_records import MAGIC, Records, UlogFields, UnknownFlags
from ros_visualise.sources.recordings import Loss

log = logging.getLogger(__name__)

_AGAIN = "copy it again from the vehicle"


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
    loss = _loss(records)
    tables = without_strays(columns, loss)
    every = {name: LogTable(one.name, one.columns) for name, one in topics.items()}
    return ULog(tables, every, records.formats.by_name, loss)


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
        loss.notes.append(f"{records.strangers} samples of topics without a description")
    if records.cut:
        loss.notes.append(f"cut off {records.cut} bytes into its last message")
    return loss

"""PX4's flight logs as recordings.

Topics: those of `ros_visualise.sources.logs.flight`, and below ``/px4`` every topic as PX4 logged
it. File format: PX4 Developer Guide, ULog File Format.
"""

from __future__ import annotations

import logging
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

import numpy as np

from ros_visualise.core.errors import OpenError
from ros_visualise.core.limits import check_log, within_limits
from ros_visualise.core.regular_files import read_file
from ros_visualise.sources.logs.logged import FlightLog, recorded_flight
from ros_visualise.sources.logs.tables import LogTable, without_strays
from ros_visualise.sources.logs.ulog_records import MAGIC, Records, UnknownFlags
from ros_visualise.sources.recordings import Loss
from ros_visualise.sources.recordings.series import SeriesRecording

log = logging.getLogger(__name__)

_TOPICS = (
    "vehicle_attitude",
    "vehicle_local_position",
    "vehicle_angular_velocity",
    "vehicle_gps_position",
    "sensor_gps",
    "sensor_combined",
)
_AGAIN = "copy it again from the vehicle"


def open_ulog(path: Path) -> SeriesRecording:
    """Open a ``.ulg`` file; stamps are in UTC where the log has GPS time, else since the start.

    Raises:
        OpenError: it is not a ULog file, or holds no positions.
    """
    found = read_ulog(path, _TOPICS)
    tables = dict(found.tables)
    if "vehicle_gps_position" in tables:
        tables["sensor_gps"] = tables["vehicle_gps_position"]
    utc_us = _utc_offset_us(tables.get("sensor_gps"))
    return recorded_flight(path, "PX4 ULog", replace(found, tables=tables, utc_us=utc_us))


def _utc_offset_us(gps: LogTable | None) -> int | None:
    """UTC minus the vehicle's clock."""
    if gps is None or not gps.has("time_utc_usec"):
        return None
    utc_us = gps.column("time_utc_usec").astype(np.int64)
    return gps.offset_us(utc_us, utc_us > 0)


def read_ulog(path: Path, names: Collection[str]) -> FlightLog:
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
    return FlightLog("px4", tables, every, records.formats.by_name, loss)


def _read(path: Path) -> Records:
    try:
        with within_limits(path):
            check_log(path.stat().st_size)
            data = read_file(path)
            if not data.startswith(MAGIC):
                raise OpenError(f"{path}: not a flight log; {_AGAIN}")
            return Records(data)
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

"""PX4's flight logs as recordings.

Topics: those of `ros_visualise.sources.logs.flight`, and below ``/px4`` every topic as PX4 logged
it. File format: PX4 Developer Guide, ULog File Format.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ros_visualise.sources.logs.logged import FlightLog, recorded_flight
from ros_visualise.sources.logs.tables import LogTable
from ros_visualise.sources.logs.ulog import read_ulog
from ros_visualise.sources.recordings.series import SeriesRecording

_TOPICS = (
    "vehicle_attitude",
    "vehicle_local_position",
    "vehicle_angular_velocity",
    "vehicle_gps_position",
    "sensor_gps",
    "sensor_combined",
)


def open_ulog(path: Path) -> SeriesRecording:
    """Open a ``.ulg`` file; stamps are in UTC where the log has GPS time, else since the start.

    Raises:
        OpenError: it is not a ULog file, or holds no positions.
    """
    log = read_ulog(path, _TOPICS)
    tables = log.tables
    if "vehicle_gps_position" in tables:
        tables["sensor_gps"] = tables["vehicle_gps_position"]
    utc_us = _utc_offset_us(tables.get("sensor_gps"))
    found = FlightLog("px4", tables, log.all, log.formats, log.loss, utc_us=utc_us)
    return recorded_flight(path, "PX4 ULog", found)


def _utc_offset_us(gps: LogTable | None) -> int | None:
    """UTC minus the vehicle's clock; the median, as the latency of the receiver varies."""
    if gps is None or not gps.has("time_utc_usec"):
        return None
    utc_us = gps.column("time_utc_usec").astype(np.int64)
    known = utc_us > 0
    if not known.any():
        return None
    return int(np.median(utc_us[known] - gps.times_us[known]))

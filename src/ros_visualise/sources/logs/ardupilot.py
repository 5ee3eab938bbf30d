"""ArduPilot's DataFlash logs as recordings.

Topics: those of `ros_visualise.sources.logs.flight`, of the first EKF core, IMU and receiver, and
below ``/ardupilot`` every logged message, in lower case: ``/ardupilot/rcou``.

Source: ArduPilot, log messages: ATT (degrees), XKF1 or NKF1 (NED, metres), IMU (FRD, SI units), GPS
(GWk, GMS; Alt above the sea), GPA (HAcc, VAcc), MNT (degrees; YawB from
the vehicle's nose).
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ros_visualise.core.limits import check_log, within_limits
from ros_visualise.core.regular_files import read_file
from ros_visualise.geometry import rotations
from ros_visualise.sources.logs.dataflash import DataFlash
from ros_visualise.sources.logs.logged import FlightLog, recorded_flight
from ros_visualise.sources.logs.tables import Column, LogTable, without_strays
from ros_visualise.sources.recordings.series import SeriesRecording

_GPS_EPOCH_US = 315_964_800_000_000
_WEEK_US = 604_800_000_000
_LEAP_US = 18_000_000
"""GPS time minus UTC since 2017."""
_POSITIONS = ("XKF1", "NKF1", "EKF1")


def open_dataflash(path: Path) -> SeriesRecording:
    """Open a ``.bin`` file; stamps are in UTC where the log has GPS time, else since the start.

    Raises:
        OpenError: it holds no positions.
    """
    with within_limits(path):
        check_log(path.stat().st_size)
        log = DataFlash(read_file(path))
    every = log.tables()
    tables = without_strays(_flight_columns(every), log.loss)
    utc_us = _utc_offset_us(every.get("GPS"))
    found = FlightLog("ardupilot", tables, every, log.formats, log.loss, utc_us=utc_us)
    return recorded_flight(path, "ArduPilot DataFlash", found)


def _flight_columns(tables: Mapping[str, LogTable]) -> dict[str, dict[str, Column]]:
    """The tables that topics are made from, with the fields and units of PX4."""
    found = {}
    if (attitude := _with(tables, ("ATT",), "Roll", "Pitch", "Yaw")) is not None:
        rpy = np.radians(attitude.columns("Roll", "Pitch", "Yaw"))
        x, y, z, w = rotations.from_rpy(rpy).T
        found["vehicle_attitude"] = _columns(attitude, "q", (w, x, y, z))
    if (position := _with(tables, _POSITIONS, "PN", "PE", "PD")) is not None:
        names = {"x": "PN", "y": "PE", "z": "PD", "vx": "VN", "vy": "VE", "vz": "VD"}
        found["vehicle_local_position"] = _renamed(position, names)
    if (imu := _with(tables, ("IMU",), "GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ")) is not None:
        rates = imu.columns("GyrX", "GyrY", "GyrZ").T
        found["vehicle_angular_velocity"] = _columns(imu, "xyz", rates)
        found["sensor_combined"] = _columns(imu, "gyro_rad", rates)
        forces = imu.columns("AccX", "AccY", "AccZ").T
        found["sensor_combined"] |= _columns(imu, "accelerometer_m_s2", forces)
    if (gps := _with(tables, ("GPS",), "Lat", "Lng", "Alt", "Status")) is not None:
        found["sensor_gps"] = _fixes(gps, _with(tables, ("GPA",), "HAcc", "VAcc"))
    if (mount := _with(tables, ("MNT",), "Roll", "Pitch", "YawB")) is not None:
        angles = np.radians(mount.columns("Roll", "Pitch", "YawB")).T
        found["gimbal"] = {"timestamp": mount.times_us} | dict(
            zip(("roll", "pitch", "yaw"), angles, strict=True)
        )
    return found


def _with(tables: Mapping[str, LogTable], names: tuple[str, ...], *fields: str) -> LogTable | None:
    """The first of these tables that has these fields."""
    return next((tables[one] for one in names if one in tables and tables[one].has(*fields)), None)


def _columns(table: LogTable, field: str, values: Column | tuple[Column, ...]) -> dict[str, Column]:
    """An array of a table."""
    columns = {f"{field}[{number}]": one for number, one in enumerate(values)}
    return {"timestamp": table.times_us, **columns}


def _renamed(table: LogTable, names: Mapping[str, str]) -> dict[str, Column]:
    columns = {name: table.column(own) for name, own in names.items() if table.has(own)}
    return {"timestamp": table.times_us, **columns}


def _fixes(gps: LogTable, accuracy: LogTable | None) -> dict[str, Column]:
    names = {"latitude_deg": "Lat", "longitude_deg": "Lng", "altitude_msl_m": "Alt"}
    found = _renamed(gps, {**names, "fix_type": "Status"})
    if accuracy is not None:
        found["eph"], found["epv"] = (
            np.interp(gps.times_us, accuracy.times_us, accuracy.column(one))
            for one in ("HAcc", "VAcc")
        )
    return found


def _utc_offset_us(gps: LogTable | None) -> int | None:
    """UTC minus the vehicle's clock."""
    if gps is None or not gps.has("GWk", "GMS"):
        return None
    weeks = gps.column("GWk")
    utc_us = _GPS_EPOCH_US - _LEAP_US + weeks * _WEEK_US + gps.column("GMS") * 1000
    return gps.offset_us(utc_us, weeks > 0)

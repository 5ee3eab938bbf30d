"""Telemetry logs of ground stations (QGroundControl, Mission Planner, MAVProxy) as recordings.

Topics: those of `ros_visualise.sources.logs.flight`, of the first vehicle, and below ``/mavlink``
every message, in lower case: ``/mavlink/battery_status``; those of other systems, such as the
ground station, below ``/mavlink/system_255``.

Source: mavlink.io, Telemetry Log File: frames, each after the time of its arrival, microseconds
since 1970, big-endian.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ros_visualise.core.limits import check_log, within_limits
from ros_visualise.core.regular_files import read_file
from ros_visualise.geometry import rotations
from ros_visualise.links.mavlink import MARKS, frame_at, is_whole, layout
from ros_visualise.sources.logs.logged import FlightLog, recorded_flight
from ros_visualise.sources.logs.tables import Column, LogTable, without_strays
from ros_visualise.sources.recordings import Loss
from ros_visualise.sources.recordings.series import SeriesRecording

_STAMP = struct.Struct(">Q")
_MARK = re.compile(b"[\xfd\xfe]")
_SPAN_US = 946_684_800_000_000, 4_102_444_800_000_000  # 2000 to 2100
_TIME = ""  # the column of the time; no field has this name
_NO_AUTOPILOT = 8
_YAW_IN_VEHICLE = 32  # of GIMBAL_DEVICE_FLAGS
_G = 9.80665e-3
_IMUS = {"HIGHRES_IMU": (1, 1), "SCALED_IMU": (_G, 1e-3), "RAW_IMU": (_G, 1e-3)}
"""IMUs -> factors of their accelerations and rates; ArduPilot scales RAW_IMU too."""


def begins_tlog(head: bytes) -> bool:
    """True for the beginning of a telemetry log: a time, and the mark of a frame."""
    if len(head) <= _STAMP.size + 8 or head[_STAMP.size] not in MARKS:
        return False
    first, last = _SPAN_US
    return bool(first < _STAMP.unpack_from(head)[0] < last)


def open_tlog(path: Path) -> SeriesRecording:
    """Open a ``.tlog`` file; stamps are the times of arrival, UTC.

    Raises:
        OpenError: it holds no positions, or pymavlink is missing.
    """
    with within_limits(path):
        check_log(path.stat().st_size)
        frames = _Frames(read_file(path))
    every, vehicles = frames.tables()
    own = {name: table for name, table in every.items() if "/" not in name}
    tables = without_strays(_flight_columns(own), frames.loss)
    others = ", ".join(str(one) for one in vehicles[1:])
    notes = (
        (f"odometry comes from system {vehicles[0]}; ignoring that of {others}",) if others else ()
    )
    formats = {one.name: one.fields for number in frames.numbers if (one := layout(number))}
    found = FlightLog("mavlink", tables, every, formats, frames.loss, notes, utc_us=0)
    return recorded_flight(path, "MAVLink telemetry log", found)


class _Frames:
    """The frames of a file, as far as they can be read.

    Attributes:
        loss: damage.
        numbers: of the messages that it holds.
    """

    def __init__(self, data: bytes) -> None:
        self.loss = Loss()
        self.numbers: set[int] = set()
        self._bodies: dict[tuple[int, int], list[bytes]] = {}
        self._times_us: dict[tuple[int, int], list[int]] = {}
        self._read(data)

    def tables(self) -> tuple[dict[str, LogTable], list[int]]:
        """Every message of the first vehicle, as ``ATTITUDE``, and the systems of all vehicles.

        Those of other systems are ``system_255/HEARTBEAT``.
        """
        columns = {key: self._columns(*key) for key in self._bodies}
        vehicles = _vehicles({s: c for (s, number), c in columns.items() if not number})
        found = {}
        for (system, number), values in columns.items():
            one = layout(number)
            assert one is not None
            name = one.name if system == vehicles[0] else f"system_{system}/{one.name}"
            found[name] = LogTable(one.name, values, _TIME)
        return found, vehicles

    def _columns(self, system: int, number: int) -> dict[str, Column]:
        one, key = layout(number), (system, number)
        assert one is not None
        table = np.frombuffer(b"".join(self._bodies[key]), one.dtype)
        columns = {name: table[name] for name in one.dtype.names or ()}
        return {**columns, _TIME: np.array(self._times_us[key], np.int64)}

    def _read(self, data: bytes) -> None:
        place = damaged = strangers = 0
        while place < len(data):
            end = self._take(data, place)
            if end:
                strangers += end < 0
                place = abs(end)
                continue
            found = _next(data, place + 1)
            if found == len(data) and data[place + 8 : place + 9] in (b"\xfe", b"\xfd"):
                size = found - place
                self.loss.add(f"cut off {size} bytes into its last message", 0, size)
                break
            damaged += found - place
            place = found
        if damaged:
            self.loss.add(f"{damaged} damaged bytes skipped", 0, damaged)
        if strangers:
            self.loss.add(f"{strangers} messages of unknown dialects skipped", strangers)

    def _take(self, data: bytes, place: int) -> int:
        """Keep a frame; its end, negative if its message is unknown; 0 without a whole one."""
        if not begins_tlog(data[place : place + 17]):
            return 0
        start = place + _STAMP.size
        frame = frame_at(data, start)
        if frame is None or not is_whole(data, start, frame):
            return 0
        one = layout(frame.number)
        if one is None:
            is_likely = frame.end == len(data) or begins_tlog(data[frame.end : frame.end + 17])
            return -frame.end if is_likely else 0
        size, key = one.dtype.itemsize, (frame.system, frame.number)
        self.numbers.add(frame.number)
        body = frame.payload[:size].ljust(size, b"\0")  # MAVLink 2 cuts zeros
        self._bodies.setdefault(key, []).append(body)
        self._times_us.setdefault(key, []).append(_STAMP.unpack_from(data, place)[0])
        return frame.end


def _next(data: bytes, start: int) -> int:
    """The next place that looks like a frame after its time; the end without one."""
    for found in _MARK.finditer(data, start + _STAMP.size):
        place = found.start() - _STAMP.size
        if begins_tlog(data[place : place + 17]):
            return place
    return len(data)


def _vehicles(heartbeats: Mapping[int, Mapping[str, Column]]) -> list[int]:
    """Systems with an autopilot, in the order in which they were heard first; else the first."""
    first = {
        system: int(columns[_TIME][columns["autopilot"] != _NO_AUTOPILOT][0])
        for system, columns in heartbeats.items()
        if (columns["autopilot"] != _NO_AUTOPILOT).any()
    }
    return sorted(first, key=first.__getitem__) or [1]


def _flight_columns(tables: Mapping[str, LogTable]) -> dict[str, dict[str, Column]]:
    """The tables that topics are made from, with the fields and units of PX4."""
    found = {}
    if (one := tables.get("ATTITUDE_QUATERNION")) is not None:
        found["vehicle_attitude"] = _columns(one, q=one.columns("q1", "q2", "q3", "q4"))
    if (one := tables.get("ATTITUDE")) is not None:
        quats = rotations.from_rpy(one.columns("roll", "pitch", "yaw"))
        found["vehicle_attitude"] = _columns(one, q=np.roll(quats, 1, axis=1))
        rates = one.columns("rollspeed", "pitchspeed", "yawspeed")
        found["vehicle_angular_velocity"] = _columns(one, xyz=rates)
    if (one := tables.get("LOCAL_POSITION_NED")) is not None:
        names = ("x", "y", "z", "vx", "vy", "vz")
        found["vehicle_local_position"] = {"timestamp": one.times_us} | {
            name: one.raw[name] for name in names
        }
    if imu := next((name for name in _IMUS if name in tables), ""):
        one, (force, rate) = tables[imu], _IMUS[imu]
        forces = force * one.columns("xacc", "yacc", "zacc")
        rates = rate * one.columns("xgyro", "ygyro", "zgyro")
        found["sensor_combined"] = _columns(one, accelerometer_m_s2=forces, gyro_rad=rates)
    if (one := tables.get("GPS_RAW_INT")) is not None:
        found["sensor_gps"] = _fixes(one)
    return found | _gimbal(tables)


def _gimbal(tables: Mapping[str, LogTable]) -> dict[str, dict[str, Column]]:
    """The angles of a gimbal in radians, by the newest of the messages that a vehicle sends."""
    if (one := tables.get("GIMBAL_DEVICE_ATTITUDE_STATUS")) is not None:
        norms = np.linalg.norm(one.vector("q", 4), axis=1)
        one = one.where((norms > 0.5) & (norms < 1.5))
        rpy = rotations.to_rpy(np.roll(one.vector("q", 4), -1, axis=1))
        on_body = (one.raw["flags"].astype(int) & _YAW_IN_VEHICLE) != 0
    elif (one := tables.get("MOUNT_ORIENTATION")) is not None:
        rpy, on_body = np.radians(one.columns("roll", "pitch", "yaw")), np.ones(len(one), bool)
    elif (one := tables.get("MOUNT_STATUS")) is not None:
        rpy = np.radians(one.columns("pointing_b", "pointing_a", "pointing_c") / 100)
        on_body = np.ones(len(one), bool)
    else:
        return {}
    angles = dict(zip(("roll", "pitch", "yaw"), rpy.T, strict=True))
    return {"gimbal": {"timestamp": one.times_us, "is_on_body": on_body, **angles}}


def _columns(table: LogTable, **arrays: Column) -> dict[str, Column]:
    """Fields that are arrays, as a table has them."""
    found = {"timestamp": table.times_us}
    for name, values in arrays.items():
        found |= {f"{name}[{number}]": column for number, column in enumerate(values.T)}
    return found


def _fixes(table: LogTable) -> dict[str, Column]:
    has_height = bool((table.column("alt_ellipsoid") != 0).any())
    found: dict[str, Column] = {
        "timestamp": table.times_us,
        "fix_type": table.raw["fix_type"],
        "latitude_deg": table.column("lat") * 1e-7,
        "longitude_deg": table.column("lon") * 1e-7,
        "altitude_msl_m": table.column("alt") * 1e-3,
    }
    if has_height:
        found["altitude_ellipsoid_m"] = table.column("alt_ellipsoid") * 1e-3
    if (table.column("h_acc") != 0).any():
        accuracies: Sequence[str] = ("h_acc", "v_acc")
        found["eph"], found["epv"] = (table.column(name) * 1e-3 for name in accuracies)
    return found

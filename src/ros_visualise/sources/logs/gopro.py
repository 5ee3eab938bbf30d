"""Fixes and inertial measurements in the films of GoPro's cameras and drones: a track of GPMF.

Source: GoPro, GPMF Introduction (gopro/gpmf-parser): KLV triplets, TYPE, SCAL; GPS5 and GPS9.
"""

from __future__ import annotations

import struct
from collections.abc import Container, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.core.limits import check_file
from ros_visualise.core.regular_files import open_file
from ros_visualise.data import Floats, Header, Imu
from ros_visualise.sources.demux import open_container
from ros_visualise.sources.series import Series, fix_series

_TRACK = "GoPro MET"
_IMU = "camera_link"
_NO_ORIENTATION = -np.eye(3) * [[1, 0, 0]]  # of what is not measured (REP 145)
_PLACES = {"GPS5": (0, 1, 2), "GPS9": (0, 1, 2), "GLPI": (1, 2, 3)}
"""Streams with positions, the better first -> columns of latitude, longitude and altitude."""
_READ = {*_PLACES, "ACCL", "GYRO"}
_FIX_OF_GPS9 = 8
_UP_RIGHT_FORWARD = np.array([[0, 0, 1], [0, -1, 0], [1, 0, 0]])
"""R_link_gopro: forward, left, up of the axes that GoPro names up, right, forward."""

_HEAD = 8
_DEEPEST = 8
_NESTED = 0
_NUMBERS = {
    **{"b": "i1", "B": "u1", "s": ">i2", "S": ">u2", "l": ">i4", "L": ">u4"},
    **{"j": ">i8", "J": ">u8", "f": ">f4", "d": ">f8"},
}
"""GPMF's types -> those of numpy; all are big-endian."""

_Times = npt.NDArray[np.int64]


class StreamSamples(NamedTuple):
    """Samples of one stream in one packet: ``values`` (N, fields), in the units of the stream.

    ``fix`` is GPSF, which holds for all: 0 none, 2 or 3 dimensions; -1 where it is missing.
    """

    key: str
    values: Floats
    fix: int


class _Item(NamedTuple):
    key: str
    kind: int
    size: int
    repeat: int
    data: bytes


_Rows = dict[str, list[tuple[_Times, StreamSamples]]]


def gopro_series(path: Path, faults: list[str]) -> Iterator[Series]:
    """The series ``fix`` and ``imu`` of a film, by its time; ``faults`` gets a note on damage.

    Raises:
        OpenError: the film cannot be opened.
        TooLarge: its telemetry takes too much.
    """
    rows: _Rows = {}
    damaged = 0
    for begin_s, length_s, packet in _packets(path):
        damaged += not is_whole(packet, _READ)
        for samples in read_samples(packet, _READ):
            count = len(samples.values)  # spread over the time of their packet
            times_s = begin_s + np.arange(count) / count * length_s
            times_ns = np.round(times_s * 1e9).astype(np.int64)
            rows.setdefault(samples.key, []).append((times_ns, samples))
    if damaged:
        faults.append(f"damaged telemetry packets, read as far as possible: {damaged}")
    yield from _fixes(rows)
    if "ACCL" in rows and "GYRO" in rows:
        yield _imu(_joined(rows["ACCL"]), _joined(rows["GYRO"]))


def read_samples(packet: bytes, keys: Container[str]) -> Iterator[StreamSamples]:
    """The samples of some streams in a packet; what cannot be read of it is skipped."""
    for stream in _streams(packet, 0):
        items = {item.key: item for item in stream}
        last = stream[-1] if stream else None
        if last is None or last.key not in keys:
            continue
        values = _values(last, items)
        if values is not None:
            fix = _values(items["GPSF"], {}) if "GPSF" in items else None
            yield StreamSamples(last.key, values, -1 if fix is None else int(fix[0, 0]))


def is_whole(packet: bytes, keys: Container[str]) -> bool:
    """True if a packet can be read to its end, and the samples of some streams in it."""
    return _is_filled(packet, 0) and all(
        _values(stream[-1], {item.key: item for item in stream}) is not None
        for stream in _streams(packet, 0)
        if stream and stream[-1].key in keys and stream[-1].repeat
    )


def _packets(path: Path) -> Iterator[tuple[float, float, bytes]]:
    """(Begin, length in seconds, data) of telemetry, by the film's index, without its images."""
    with open_container(path) as container:
        tracks = (
            one
            for one in container.streams
            if one.type == "data" and _TRACK in one.metadata.get("handler_name", "")
        )
        track = next(tracks, None)
        if track is None:
            return
        tick_s = float(track.time_base or 0)
        places = [(one.timestamp, one.pos, one.size) for one in track.index_entries]
        ends = [*(begin for begin, _, _ in places[1:]), track.duration or 0]
    check_file(sum(size for _, _, size in places))
    with open_file(path) as file:
        for (begin, position, size), end in zip(places, ends, strict=False):
            file.seek(max(0, position))
            yield begin * tick_s, max(0, end - begin) * tick_s, file.read(max(0, size))


def _joined(rows: list[tuple[_Times, StreamSamples]]) -> tuple[_Times, Floats]:
    width = rows[0][1].values.shape[1]
    same = [(times, one.values) for times, one in rows if one.values.shape[1] == width]
    times_ns, values = zip(*same, strict=True)
    return np.concatenate(times_ns), np.concatenate(values)


def _fixes(rows: _Rows) -> Iterator[Series]:
    key = next((key for key in _PLACES if key in rows), None)
    if key is None:
        return
    stamps_ns, values = _joined(rows[key])
    if values.shape[1] <= max(_PLACES[key]):
        return
    known = np.concatenate([np.full(len(times), one.fix) for times, one in rows[key]]) != 0
    if key == "GPS9" and values.shape[1] > _FIX_OF_GPS9:
        known = values[:, _FIX_OF_GPS9] > 0
    yield fix_series("fix", stamps_ns, values[:, _PLACES[key]], known[: len(values)])


def _imu(accelerations: tuple[_Times, Floats], rates: tuple[_Times, Floats]) -> Series:
    """Inertial measurements at the times of the accelerometer; rates are interpolated."""
    stamps_ns, linear = accelerations
    linear = linear[:, :3] @ _UP_RIGHT_FORWARD.T
    columns = [np.interp(stamps_ns, rates[0], column) for column in rates[1][:, :3].T]
    angular = np.stack(columns, axis=1) @ _UP_RIGHT_FORWARD.T

    def imu(index: int) -> Imu:
        return Imu(
            np.array([0.0, 0, 0, 1]),
            angular[index],
            linear[index],
            orientation_covariance=_NO_ORIENTATION,
            angular_covariance=np.zeros((3, 3)),
            linear_covariance=np.zeros((3, 3)),
            header=Header(int(stamps_ns[index]), _IMU),
        )

    return Series("imu", Imu, stamps_ns, imu)


def _is_filled(data: bytes, depth: int) -> bool:
    """True if items fill all of it, but for zeros at its end."""
    end = 0
    for item in _items(data):
        if not item.key.isprintable():
            break
        is_nested = item.kind == _NESTED and depth <= _DEEPEST
        if is_nested and not _is_filled(item.data, depth + 1):
            return False
        end += _HEAD + len(item.data) + -len(item.data) % 4
    return not any(data[end:])


def _streams(data: bytes, depth: int) -> Iterator[list[_Item]]:
    for item in _items(data):
        if item.kind != _NESTED or depth > _DEEPEST:
            continue
        if item.key == "STRM":
            yield list(_items(item.data))
        else:
            yield from _streams(item.data, depth + 1)


def _items(data: bytes) -> Iterator[_Item]:
    place = 0
    while place + _HEAD <= len(data):
        key, kind, size, repeat = struct.unpack_from(">4sBBH", data, place)
        place += _HEAD
        end = place + size * repeat
        if end > len(data):
            return
        yield _Item(key.decode("latin-1"), kind, size, repeat, data[place:end])
        place = end + -(size * repeat) % 4


def _values(item: _Item, items: dict[str, _Item]) -> Floats | None:
    """(N, fields) of the last item of a stream, in its units."""
    letters = chr(item.kind)
    if letters == "?":
        letters = items["TYPE"].data.decode("latin-1").rstrip("\0") if "TYPE" in items else ""
    elif letters in _NUMBERS:
        letters *= item.size // np.dtype(_NUMBERS[letters]).itemsize
    if not letters or any(letter not in _NUMBERS for letter in letters):
        return None
    row = np.dtype([(f"f{n}", _NUMBERS[letter]) for n, letter in enumerate(letters)])
    if row.itemsize != item.size or not item.repeat:
        return None
    table = np.frombuffer(item.data, row)
    values = np.stack([table[name].astype(np.float64) for name in row.names or ()], axis=1)
    scale = _values(items["SCAL"], {}) if "SCAL" in items else None
    if scale is None:
        return values
    if scale.size not in (1, values.shape[1]) or not scale.all():
        return None
    return np.asarray(values / scale.ravel())

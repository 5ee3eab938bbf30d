"""What a drone or a camera measured beside its film, by the time in the film.

GoPro's telemetry is a track of the film itself; DJI's are subtitles, in the film's folder and with
its name. There are fixes, and of GoPro's cameras accelerations and rates.
"""

from __future__ import annotations

import heapq
import logging
import math
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import OpenError, TooLarge
from ros_visualise.core.limits import check_file, check_text
from ros_visualise.core.regular_files import open_file, read_file
from ros_visualise.data import Floats, Header, Imu, NavSatFix
from ros_visualise.sources.demux import open_container
from ros_visualise.sources.logs.dji import begins_srt, decode_srt, parse_srt
from ros_visualise.sources.logs.gopro import Samples, is_whole, read_samples
from ros_visualise.sources.series import Series
from ros_visualise.sources.video import Video

log = logging.getLogger(__name__)

_TRACK = "GoPro MET"
_FIX, _NO_FIX = 0, -1
_NO_ORIENTATION = -np.eye(3) * [[1, 0, 0]]  # of what is not measured (REP 145)
_GPS, _IMU = "gps", "camera_link"
_PLACES = {"GPS5": (0, 1, 2), "GPS9": (0, 1, 2), "GLPI": (1, 2, 3)}
"""Streams with latitude, longitude and altitude, the better first, and where these stand."""
_READ = {*_PLACES, "ACCL", "GYRO"}
_FIX_OF_GPS9 = 8
_UP_RIGHT_FORWARD = np.array([[0, 0, 1], [0, -1, 0], [1, 0, 0]])
"""R_link_gopro: forward, left, up of the axes that GoPro names up, right, forward."""


def telemetry_of(film: str | Path, faults: list[str] | None = None) -> list[Series]:
    """The series that a film comes with, called ``fix`` and ``imu``; stamps count from its start.

    There are none in a film that cannot be opened: whoever plays it says why.

    Args:
        film: the file.
        faults: takes what is damaged in its telemetry.
    """
    path = Path(film)
    try:
        return list(_of_gopro(path, [] if faults is None else faults)) or _of_dji(path)
    except TooLarge as error:
        log.warning("%s: played without its telemetry: %s", path, error)
    except OpenError:
        pass
    return []


def _of_gopro(path: Path, faults: list[str]) -> Iterator[Series]:
    rows: dict[str, list[tuple[npt.NDArray[np.int64], Samples]]] = {}
    damaged = 0
    for packet in _packets(path):
        damaged += not is_whole(packet.data, _READ)
        for samples in read_samples(packet.data, _READ):
            rows.setdefault(samples.key, []).append((packet.times_ns(len(samples.values)), samples))
    if damaged:
        faults.append(f"damaged packets of its telemetry, skipped as far as damaged: {damaged}")
    yield from _fixes(rows)
    if "ACCL" in rows and "GYRO" in rows:
        yield _imu(*(_joined(rows[key]) for key in ("ACCL", "GYRO")))


class _Packet(NamedTuple):
    """What was measured in a part of the film, in seconds."""

    begin_s: float
    length_s: float
    data: bytes

    def times_ns(self, count: int) -> npt.NDArray[np.int64]:
        """(N,) times in the film: samples are spread over the time of their packet."""
        times_s = self.begin_s + np.arange(count) / count * self.length_s
        return np.round(times_s * 1e9).astype(np.int64)


def _packets(path: Path) -> Iterator[_Packet]:
    """The packets of the track of telemetry, read by the film's index and without its images.

    Raises:
        TooLarge: they would take too much.
    """
    with open_container(path) as container:
        tracks = [
            one
            for one in container.streams
            if one.type == "data" and _TRACK in one.metadata.get("handler_name", "")
        ]
        track = tracks[0] if tracks else None
        if track is None:
            return
        tick_s = float(track.time_base or 0)
        places = [(one.timestamp, one.pos, one.size) for one in track.index_entries]
        ends = [*(begin for begin, _, _ in places[1:]), track.duration or 0]
    check_file(sum(size for _, _, size in places))
    with open_file(path) as file:
        for (begin, position, size), end in zip(places, ends, strict=False):
            file.seek(max(0, position))
            data = file.read(max(0, size))
            yield _Packet(begin * tick_s, max(0, end - begin) * tick_s, data)


def _joined(rows: list[tuple[npt.NDArray[np.int64], Samples]]) -> tuple[Any, Floats]:
    width = rows[0][1].values.shape[1]
    same = [(times, one.values) for times, one in rows if one.values.shape[1] == width]
    return tuple(np.concatenate(part) for part in zip(*same, strict=True))  # type: ignore[return-value]


def _fixes(rows: dict[str, list[tuple[npt.NDArray[np.int64], Samples]]]) -> Iterator[Series]:
    key = next((key for key in _PLACES if key in rows), None)
    if key is None:
        return
    stamps_ns, values = _joined(rows[key])
    if values.shape[1] <= max(_PLACES[key]):
        return
    places = values[:, _PLACES[key]]
    known = np.concatenate([np.full(len(times), one.fix) for times, one in rows[key]]) != 0
    if key == "GPS9" and values.shape[1] > _FIX_OF_GPS9:
        known = values[:, _FIX_OF_GPS9] > 0
    yield _fix_series(stamps_ns, places, known[: len(places)])


def _imu(accelerations: tuple[Any, Floats], rates: tuple[Any, Floats]) -> Series:
    """At the times of the accelerometer; rates are interpolated."""
    stamps_ns, linear = accelerations
    linear = linear[:, :3] @ _UP_RIGHT_FORWARD.T
    columns = [np.interp(stamps_ns, rates[0], column) for column in rates[1][:, :3].T]
    angular = np.stack(columns, axis=1) @ _UP_RIGHT_FORWARD.T

    def imu(index: int) -> Imu:
        header = Header(int(stamps_ns[index]), _IMU)
        level = np.array([0.0, 0, 0, 1])
        return Imu(
            level,
            angular[index],
            linear[index],
            orientation_covariance=_NO_ORIENTATION,
            angular_covariance=np.zeros((3, 3)),
            linear_covariance=np.zeros((3, 3)),
            header=header,
        )

    return Series("imu", Imu, stamps_ns, imu)


def _of_dji(path: Path) -> list[Series]:
    beside = next(
        (path.with_suffix(s) for s in (".SRT", ".srt") if path.with_suffix(s).is_file()), None
    )
    if beside is None or beside == path:
        return []
    check_text(beside.stat().st_size)
    data = read_file(beside)
    subtitles = list(parse_srt(decode_srt(data))) if begins_srt(data[:1000]) else []
    if not any(one.has_fix for one in subtitles):
        return []
    heights = [one.altitude if math.isfinite(one.altitude) else one.height for one in subtitles]
    places = np.array(
        [(one.latitude, one.longitude, high) for one, high in zip(subtitles, heights, strict=True)]
    )
    known = np.array([one.has_fix for one in subtitles])
    return [_fix_series(np.array([one.begin_ns for one in subtitles]), places, known)]


def _fix_series(
    stamps_ns: npt.NDArray[np.int64], places: Floats, known: npt.NDArray[np.bool_]
) -> Series:
    def fix(index: int) -> NavSatFix:
        latitude, longitude, altitude = places[index].tolist()
        header = Header(int(stamps_ns[index]), _GPS)
        status = _FIX if known[index] else _NO_FIX
        return NavSatFix(latitude, longitude, altitude, status=status, header=header)

    return Series("fix", NavSatFix, np.asarray(stamps_ns, np.int64), fix)


_IMAGE = "image"


class Item(NamedTuple):
    """A message, and the name of the output that it is for."""

    output: str
    message: Any


class Film:
    """The images of a video, and the messages of series by the time in it."""

    def __init__(self, video: Video, series: Sequence[Series]) -> None:
        self._video, self._series = video, series

    @property
    def duration_ns(self) -> int | None:
        """That of the video."""
        return self._video.duration_ns

    def is_frame(self, item: Item) -> bool:
        """Whether a person steps to it: images are what is stepped through."""
        return item.output == _IMAGE

    def read(self, start_ns: int = 0) -> Generator[tuple[int, Item], None, None]:
        """(Time since the first frame, item), from the frame shown at ``start_ns`` on."""
        with closing(self._video.read(start_ns)) as frames:
            images = ((time_ns, Item(_IMAGE, image)) for time_ns, image in frames)
            first = next(images, None)
            if first is None:
                return
            yield first
            parts = [_measured(one, max(first[0], start_ns)) for one in self._series]
            yield from heapq.merge(images, *parts, key=lambda timed: timed[0])


def _measured(series: Series, start_ns: int) -> Iterator[tuple[int, Item]]:
    order = np.argsort(series.stamps_ns, kind="stable")
    begin = int(np.searchsorted(series.stamps_ns[order], start_ns))
    for index in order[begin:]:
        time_ns = max(int(series.stamps_ns[index]), 0)
        yield time_ns, Item(series.topic, series.make(int(index)))

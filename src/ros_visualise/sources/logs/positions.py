"""Tracks of positions in GPX files and in tables (CSV), with the camera's angles if they have them.

Topics: ``/fix``, and as of `ros_visualise.sources.camera_poses` if there are angles. Tables have a
line of names, such as those of AirData: ``latitude``, ``longitude``, ``altitude``, ``height`` above
the point of take-off, ``yaw``, ``pitch`` and ``roll`` of the camera, ``time``; units are in
brackets behind them. Times are dates (ISO 8601), or counted since 1970 or the start.

Source: Topografix, GPX 1.1 schema.
"""

from __future__ import annotations

import csv
import io
import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import OpenError
from ros_visualise.core.limits import check_text, within_limits
from ros_visualise.core.regular_files import read_file
from ros_visualise.data import Floats
from ros_visualise.sources.camera_poses import (
    CameraPoses,
    above_ground,
    angle_quats,
    camera_series,
    optical_quats,
)
from ros_visualise.sources.recordings import Loss
from ros_visualise.sources.recordings.series import SeriesRecording

_GPX = re.compile(rb"\A(\xef\xbb\xbf)?\s*(<\?xml[^>]*>\s*)?(<!--.*?-->\s*)*<gpx\b", re.DOTALL)
_COLUMNS = {
    "time": ("time", "timestamp", "datetime", "date", "utc", "t"),
    "latitude": ("latitude", "lat", "gpslatitude"),
    "longitude": ("longitude", "lon", "lng", "long", "gpslongitude"),
    "altitude": ("altitude", "alt", "absalt", "altitudeabovesealevel", "elevation", "ele"),
    "height": ("height", "relalt", "relativealtitude", "heightabovetakeoff", "heightagl"),
    "yaw": ("gimbalheading", "gimbalyaw", "camerayaw", "yaw", "heading"),
    "pitch": ("gimbalpitch", "camerapitch", "pitch"),
    "roll": ("gimbalroll", "cameraroll", "roll"),
}
"""Column -> its names, the preferred ones first, in small letters and digits alone."""
_UNITS = {"feet": 0.3048, "ft": 0.3048, "millisecond": 1e-3, "milliseconds": 1e-3, "ms": 1e-3}
_UNITS |= {"us": 1e-6, "ns": 1e-9, "rad": 180 / math.pi, "radians": 180 / math.pi}
_FRACTION = re.compile(r"\.(\d{1,6})\d*")  # of seconds; before Python 3.11 of six digits alone
_EPOCHS = ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3))
"""Least number of a date in ns, us and ms since 1970 -> its unit."""


def begins_gpx(head: bytes) -> bool:
    """True if a file that begins so is GPX."""
    return bool(_GPX.match(head))


def begins_positions(head: bytes) -> bool:
    """True if a file that begins so is a table of positions."""
    text = head.decode("utf-8-sig", "replace")
    return b"\0" not in head and {"latitude", "longitude"} <= _found(_names(text)).keys()


def open_gpx(path: Path) -> SeriesRecording:
    """Open a GPX file: the points of its tracks, else of its routes; raises OpenError."""
    data = _data(path)
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise OpenError(f"{path}: GPX with a DOCTYPE is not supported")
    loss, points = Loss(), []
    parser: Any = ET.XMLPullParser(("end",))
    try:
        parser.feed(data)
        parser.close()
    except ET.ParseError as error:
        loss.add(f"not read beyond the first error: {error}")
    for _, one in parser.read_events():  # what is whole before a fault
        if one.tag.rpartition("}")[2] in ("trkpt", "rtept"):
            points.append(_point(one))
    return _recorded(path, "GPX", [row for row in points if row], loss)


def open_positions(path: Path) -> SeriesRecording:
    """Open a table of positions; raises OpenError."""
    text = _data(path).decode("utf-8-sig", "replace")
    columns = _found(_names(text))
    table, loss = [], Loss()
    try:
        rows = list(_rows(text))[1:]
    except csv.Error as error:
        raise OpenError(f"{path}: not a readable table: {error}") from None
    for row in rows:
        found = {
            name: row[place] if name == "time" else _scaled(row[place], unit)
            for name, (place, unit) in columns.items()
            if place < len(row)
        }
        if len(found) < len(columns):
            loss.messages += 1
            continue
        if isinstance(time := found.get("time"), str):
            found["time"] = _seconds(time, columns["time"][1])
        table.append({name: float(value) for name, value in found.items()})
    if loss.messages:
        loss.notes.append(f"{loss.messages} rows are too short")
    return _recorded(path, "table of positions", table, loss)


def _data(path: Path) -> bytes:
    with within_limits(path):
        check_text(path.stat().st_size)
    return read_file(path)


def _point(one: ET.Element) -> dict[str, float]:
    texts = {child.tag.rpartition("}")[2]: child.text or "" for child in one}
    return {
        "latitude": _scaled(one.get("lat", ""), 1),
        "longitude": _scaled(one.get("lon", ""), 1),
        "altitude": _scaled(texts.get("ele", ""), 1),
        "time": _seconds(texts.get("time", ""), 1),
    }


def _recorded(
    path: Path, format: str, rows: Sequence[Mapping[str, float]], loss: Loss
) -> SeriesRecording:
    columns = {
        name: np.array([row.get(name, math.nan) for row in rows], np.float64) for name in _COLUMNS
    }
    stamps_ns, notes = _stamps_ns(columns["time"])
    up, ground_m = above_ground(columns["altitude"], columns["height"])
    places = np.column_stack([columns["latitude"], columns["longitude"], up])
    places[(places[:, :2] == 0).all(axis=1)] = np.nan
    angles = np.column_stack([columns["yaw"], columns["pitch"], columns["roll"]])
    angles[:, 2] = np.where(np.isfinite(angles[:, 2]), angles[:, 2], 0)
    poses = CameraPoses(stamps_ns, places, optical_quats(angle_quats(angles)), ground_m)
    if not poses.is_placed.any():
        raise OpenError(f"{path}: contains no positions")
    series = [replace(one, topic=f"/{one.topic}") for one in camera_series(poses)]
    return SeriesRecording(path, format, path.stat().st_size, series, notes, loss=loss)


def _stamps_ns(seconds: Floats) -> tuple[npt.NDArray[np.int64], list[str]]:
    if len(seconds) and np.isfinite(seconds).all():
        return np.round(np.clip(seconds, 0, 4e9) * 1e9).astype(np.int64), []
    return np.arange(len(seconds)) * 10**9, ["points without a time: taken as one each second"]


def _names(text: str) -> list[str]:
    """Words of the first line."""
    try:
        return next(_rows(text), [])
    except csv.Error:  # a word of more than 128 KiB
        return []


def _rows(text: str) -> Iterator[list[str]]:
    """The rows that are not empty."""
    first = re.split("[\r\n]", text, maxsplit=1)[0]
    lines = io.StringIO(text, newline=None)  # any ends of lines
    return filter(None, csv.reader(lines, delimiter=max(",;\t", key=first.count)))


def _found(names: Sequence[str]) -> dict[str, tuple[int, float]]:
    """Column -> its place and its unit."""
    known: dict[str, tuple[int, float]] = {}
    plain = []
    for name in names:
        word, _, unit = name.strip().lower().partition("(")
        plain.append((re.sub("[^a-z0-9]", "", word), _UNITS.get(unit.strip(") "), 1.0)))
    for column, words in _COLUMNS.items():
        places = ((n, unit) for word in words for n, (own, unit) in enumerate(plain) if own == word)
        if (first := next(places, None)) is not None:
            known[column] = first
    return known


def _scaled(text: str, unit: float) -> float:
    try:
        return float(text.replace(",", ".")) * unit
    except ValueError:
        return math.nan


def _seconds(text: str, unit: float) -> float:
    """A time in seconds: a date in UTC, a number since 1970 or since the start."""
    number = _scaled(text, 1.0)
    if math.isfinite(number):
        fitting = (scale for least, scale in _EPOCHS if number >= least)
        return number * next(fitting, unit)
    whole = _FRACTION.sub(lambda found: f".{found[1]:0<6}", text.strip().replace("Z", "+00:00"))
    try:
        date = datetime.fromisoformat(whole)
    except ValueError:
        return math.nan
    return (date if date.tzinfo else date.replace(tzinfo=timezone.utc)).timestamp()

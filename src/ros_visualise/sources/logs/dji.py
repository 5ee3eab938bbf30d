"""GPS fixes from the subtitles of DJI's drones: an ``.SRT`` file, alone or beside a film.

Alone it is a recording of ``/gps/fix``. Its stamps are those of the camera's clock, which shows
local time and is read as UTC, where the subtitles have dates; else they are the time in the film.
Where that clock goes back, the film began at its first date. Altitudes are above the sea where the
subtitles have them, else above the point of take-off. Beside a film, subtitles with the angles of
the gimbal give the pose of its camera, and its lens by the focal length if they have it.
"""

from __future__ import annotations

import codecs
import datetime
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, pairwise
from pathlib import Path

import numpy as np

from ros_visualise.core.errors import OpenError
from ros_visualise.core.limits import check_text, within_limits
from ros_visualise.core.regular_files import read_file
from ros_visualise.data import CameraInfo
from ros_visualise.sources.camera_poses import (
    CameraPoses,
    above_ground,
    angle_quats,
    camera_series,
    lens_series,
    optical_quats,
)
from ros_visualise.sources.demux import open_container, video_stream
from ros_visualise.sources.recordings import Loss
from ros_visualise.sources.recordings.series import SeriesRecording
from ros_visualise.sources.series import Series, fix_series
from ros_visualise.vision.lens_table import lens_of_focal

_NS = 1_000_000_000
_NUMBER = r"([-+]?\d+(?:[.,]\d+)?)"  # some apps write decimals as the phone's language does
_START = re.compile(r"\s*\d+\s*\n[\d:,. ]+-->")
_HEAD_BYTES = 1000
_SUBTITLE = re.compile(  # without bounds, it would take years where lines are empty
    r"^[^\S\n]{0,9}(\d{1,9})\s{0,9}\n\s{0,9}(\d{1,4}):(\d\d):(\d\d)[,.](\d{1,3})"
    r"\s{0,9}-->[^\n]*\n?",
    re.MULTILINE,
)
_DATE = re.compile(
    r"(\d{4})[.-](\d\d)[.-](\d\d)[ T](\d\d):(\d\d):(\d\d)(?:[.,:](\d{3}))?(?:[.,:](\d{3}))?"
)
_NO_TEXT = re.compile("[\0\ufffd]")
_FIGURES = re.compile(r"[-+.\d]+")
_TURNS = ("yaw", "pitch", "roll")
_GPS = tuple(
    re.compile(rf"\bGPS\s*\(\s*{number}\s*[,;]\s*{number}\s*[,;)]")
    for number in (r"([-+]?\d+,\d+)", r"([-+]?\d+(?:\.\d+)?)")
)
_LATITUDE = re.compile(rf"\[\s*latitude\s*:?\s*{_NUMBER}\s*\]", re.IGNORECASE)
_LONGITUDE = re.compile(rf"\[\s*long(?:i|ti)tude\s*:?\s*{_NUMBER}\s*\]", re.IGNORECASE)
_ABSOLUTE = re.compile(rf"\babs_alt\s*:?\s*{_NUMBER}\s*[\]\s]", re.IGNORECASE)
_RELATIVE = re.compile(
    rf"(?:\brel_alt|\[\s*altitude|\bBAROMETER)\s*:?\s*{_NUMBER}\s*[\]\s,m]|\bH\s+{_NUMBER}\s*m",
    re.IGNORECASE,
)
_ANGLES = tuple(re.compile(rf"\bgb_{name}\s*:?\s*{_NUMBER}\s*[\]\s,]") for name in _TURNS)
_FOCAL = re.compile(rf"\bfocal_len\s*:?\s*{_NUMBER}\s*\]")
_LARGEST = 1e5
_LONGEST_MM = 100.0  # above it, focal lengths are in tenths


@dataclass(frozen=True, slots=True)
class _Subtitle:
    """Content of one subtitle; missing numbers are NaN.

    ``begin_ns`` is its time in the film; ``date_ns`` the camera's clock as if it showed UTC, or
    None; ``date_is_fine`` is true if that has parts of seconds. ``altitude`` is in metres above
    the sea, ``height`` above the point of take-off. ``angles`` are yaw, pitch and roll of the
    gimbal in degrees, ``focal_mm`` the focal length as of 36 x 24 mm.
    """

    number: int
    begin_ns: int
    date_ns: int | None
    date_is_fine: bool
    latitude: float
    longitude: float
    altitude: float
    height: float
    angles: tuple[float, float, float]
    focal_mm: float

    @property
    def has_fix(self) -> bool:
        """True if it has a position; without a fix, cameras write zeros."""
        place = abs(self.latitude) <= 90 and abs(self.longitude) <= 180
        return place and (self.latitude, self.longitude) != (0, 0)


def begins_srt(head: bytes) -> bool:
    """True if a file that begins so holds subtitles."""
    return bool(_START.match(_decode(head)))


def open_srt(path: Path) -> SeriesRecording:
    """Open a file of subtitles; those without a position become fixes whose status is "no fix"."""
    with within_limits(path):
        text, subtitles = _read(path)
    if not any(one.has_fix for one in subtitles):
        raise OpenError(f"{path}: no GPS positions; DJI's subtitles have them if GPS was on")
    stamps_ns, clock, notes = _stamps_ns(subtitles)
    if all(math.isnan(one.altitude) for one in subtitles):
        has_heights = not all(math.isnan(one.height) for one in subtitles)
        notes.append(
            "altitudes are relative to the take-off point" if has_heights else "no altitudes"
        )
    series = [_fixes("/gps/fix", subtitles, stamps_ns)]
    size = path.stat().st_size
    loss = _loss(text, subtitles)
    return SeriesRecording(path, f"DJI SRT ({clock})", size, series, notes, loss=loss)


def fixes_beside(film: Path) -> list[Series]:
    """The fixes in the subtitles beside a film, by the time in the film; raises TooLarge."""
    for path in (film.with_suffix(".SRT"), film.with_suffix(".srt")):
        if path.is_file() and path != film:
            text, subtitles = _read(path)
            if begins_srt(text[:_HEAD_BYTES].encode()) and any(one.has_fix for one in subtitles):
                return _camera(film, subtitles)
            break
    return []


def _camera(film: Path, subtitles: Sequence[_Subtitle]) -> list[Series]:
    """The camera of a film, by the time in it: its fixes, and its pose and lens if known."""
    stamps_ns = [one.begin_ns for one in subtitles]
    fixes = _fixes("fix", subtitles, stamps_ns)
    quats = optical_quats(angle_quats([one.angles for one in subtitles]))
    altitudes = np.array([one.altitude for one in subtitles])
    heights = np.array([one.height for one in subtitles])
    up, ground_m = above_ground(altitudes, heights)
    places = np.column_stack(
        [[one.latitude for one in subtitles], [one.longitude for one in subtitles], up]
    )
    places[[not one.has_fix for one in subtitles]] = np.nan
    poses = CameraPoses(np.array(stamps_ns, np.int64), places, quats, ground_m)
    beside = [one for one in camera_series(poses) if one.topic != fixes.topic]
    return [*beside, fixes, *lens_series(_lenses(film, subtitles))]


def _lenses(film: Path, subtitles: Sequence[_Subtitle]) -> Iterator[tuple[int, CameraInfo]]:
    with open_container(film) as container:
        codec = video_stream(container, film).codec_context
        size = (codec.width, codec.height)
    last = math.nan
    for one in subtitles:
        focal_mm = one.focal_mm / (10 if one.focal_mm > _LONGEST_MM else 1)
        if focal_mm > 0 and focal_mm != last:
            last = focal_mm
            yield one.begin_ns, lens_of_focal(focal_mm, size)


def _read(path: Path) -> tuple[str, list[_Subtitle]]:
    check_text(path.stat().st_size)
    text = _decode(read_file(path))
    return text, [_parse(start, said) for start, said in _split(text)]


def _decode(data: bytes) -> str:
    """Text of a file: UTF-16 where it begins with that mark, else UTF-8."""
    is_utf16 = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    text = data.decode("utf-16" if is_utf16 else "utf-8-sig", errors="replace")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _split(text: str) -> Iterator[tuple[re.Match[str], str]]:
    """Number and times of each subtitle, and its text."""
    for one, following in pairwise(chain(_SUBTITLE.finditer(text), [None])):
        assert one is not None
        yield one, text[one.end() : following.start() if following else None]


def _parse(start: re.Match[str], text: str) -> _Subtitle:
    number, hours, minutes, seconds = map(int, start.groups()[:4])
    begin_s = 60 * (60 * hours + minutes) + seconds
    begin_ns = begin_s * _NS + int(start[5].ljust(3, "0")) * 1_000_000
    position, heights = _position(text), (_number(_ABSOLUTE, text), _number(_RELATIVE, text))
    yaw, pitch, roll = (_number(one, text) for one in _ANGLES)
    rest = (yaw, pitch, roll), _number(_FOCAL, text)
    return _Subtitle(number, begin_ns, *_date(text), *position, *heights, *rest)


def _position(text: str) -> tuple[float, float]:
    """Latitude and longitude; ``GPS(...)`` has the longitude first, but not in all models."""
    pair = next(filter(None, (one.search(text) for one in _GPS)), None)
    if pair is None:
        return _number(_LATITUDE, text), _number(_LONGITUDE, text)
    longitude, latitude = _float(pair[1]), _float(pair[2])
    return (longitude, latitude) if abs(latitude) > 90 else (latitude, longitude)


def _number(pattern: re.Pattern[str], text: str) -> float:
    found = pattern.search(text)
    return _float(next(filter(None, found.groups()))) if found else math.nan


def _float(text: str) -> float:
    """A number with a point or a comma; NaN for what no drone measures."""
    number = float(text.replace(",", "."))
    return number if abs(number) < _LARGEST else math.nan


def _date(text: str) -> tuple[int | None, bool]:
    found = _DATE.search(text)
    if found is None:
        return None, False
    try:
        date = datetime.datetime(*map(int, found.groups()[:6]), tzinfo=datetime.timezone.utc)  # type: ignore[misc,arg-type]
    except ValueError:
        return None, False
    milliseconds, microseconds = int(found[7] or 0), int(found[8] or 0)
    ns = int(date.timestamp()) * _NS + milliseconds * 1_000_000 + microseconds * 1000
    return ns, found[7] is not None


def _fixes(topic: str, subtitles: Sequence[_Subtitle], stamps_ns: Sequence[int]) -> Series:
    """Their fixes, all with one kind of altitude."""
    has_altitudes = any(math.isfinite(one.altitude) for one in subtitles)
    places = [
        (one.latitude, one.longitude, one.altitude if has_altitudes else one.height)
        for one in subtitles
    ]
    known = np.array([one.has_fix for one in subtitles])
    return fix_series(topic, np.array(stamps_ns, np.int64), np.array(places), known)


def _stamps_ns(subtitles: Sequence[_Subtitle]) -> tuple[list[int], str, list[str]]:
    """Their stamps, the name of the clock, and notes.

    Dates of whole seconds, and those that go back, only tell when the film began.
    """
    dates_ns = [one.date_ns for one in subtitles if one.date_ns is not None]
    notes: list[str] = []
    if len(dates_ns) == len(subtitles) and all(one.date_is_fine for one in subtitles):
        if not (back := _steps_back(dates_ns)):
            return dates_ns, "camera's clock", notes
        notes.append(
            f"the camera's clock jumps back {back}, so stamps follow the time in the video"
        )
    began_ns = next((one.date_ns - one.begin_ns for one in subtitles if one.date_ns is not None), 0)
    stamps_ns = [began_ns + one.begin_ns for one in subtitles]
    if back := _steps_back(stamps_ns):
        notes.append(f"the time in the video jumps back {back}, so fixes are sorted by that time")
    return stamps_ns, "camera's clock" if dates_ns else "time in the video", notes


def _steps_back(times_ns: Sequence[int]) -> str:
    """Number of times that a clock goes back, in words; empty: never."""
    count = sum(b < a for a, b in pairwise(times_ns))
    return f"{count} times" if count > 1 else "once" * count


def _loss(text: str, subtitles: Sequence[_Subtitle]) -> Loss:
    numbers = [one.number for one in subtitles]
    loss = Loss(sum(max(0, b - a - 1) for a, b in pairwise(numbers)))
    if loss.messages:
        loss.notes.append(f"{loss.messages} subtitles are missing or damaged")
    if _ends_cut(text):
        loss.notes.append("cut off within the last subtitle")
    return loss


def _ends_cut(text: str) -> bool:
    """True if the last subtitle holds only a part of what others hold, or more than text."""
    *others, last = (_form(said) for _, said in _split(text))
    if _NO_TEXT.search(last):
        return True
    return last not in others and any(
        whole.startswith(last) or last.startswith(f"{whole}\n") for whole in set(others)
    )


def _form(said: str) -> str:
    """A subtitle's text without its figures and blanks."""
    return re.sub(r"\s*\n\s*", "\n", _FIGURES.sub("0", said)).strip()

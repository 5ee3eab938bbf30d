"""The subtitles (``.SRT``) beside the films of DJI's drones as recordings: ``/gps/fix``.

Stamps are by the camera's clock, which shows its local time and is taken for UTC, where the
subtitles have dates; else they are the time in the film. Where that clock goes back, the film began
at its first date. Altitudes are those above the sea where the subtitles say them, else above where
the drone took off. What they say of the camera is left out.
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
import numpy.typing as npt

from ros_visualise.core.errors import OpenError, TooLarge
from ros_visualise.core.limits import check_text
from ros_visualise.core.regular_files import read_file
from ros_visualise.data import Header, NavSatFix
from ros_visualise.sources.recordings import Loss
from ros_visualise.sources.recordings.series import SeriesRecording
from ros_visualise.sources.series import Series

_NS = 1_000_000_000
_NUMBER = r"([-+]?\d+(?:\.\d+)?)"
_START = re.compile(r"\s*\d+\s*\n[\d:,. ]+-->")
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
_GPS = re.compile(rf"\bGPS\s*\(\s*{_NUMBER}\s*,\s*{_NUMBER}\s*[,)]")
_LATITUDE = re.compile(rf"\[\s*latitude\s*:?\s*{_NUMBER}\s*\]")
_LONGITUDE = re.compile(rf"\[\s*long(?:i|ti)tude\s*:?\s*{_NUMBER}\s*\]")
_ABSOLUTE = re.compile(rf"\babs_alt\s*:?\s*{_NUMBER}\s*[\]\s]")
_RELATIVE = re.compile(
    rf"(?:\brel_alt|\[\s*altitude|\bBAROMETER)\s*:?\s*{_NUMBER}\s*[\]\s,mM]|\bH\s+{_NUMBER}\s*m"
)


@dataclass(frozen=True, slots=True)
class Subtitle:
    """What one says; numbers that it does not say are no numbers (nan).

    ``begin_ns`` is its time in the film; ``date_ns`` the camera's clock as if it showed UTC, or
    None, and ``date_is_fine`` whether that has parts of seconds. ``altitude`` is in metres above
    the sea, ``height`` above where the drone took off.
    """

    number: int
    begin_ns: int
    date_ns: int | None
    date_is_fine: bool
    latitude: float
    longitude: float
    altitude: float
    height: float

    @property
    def has_fix(self) -> bool:
        """Whether it has a position; without a fix, cameras write zeros."""
        place = abs(self.latitude) <= 90 and abs(self.longitude) <= 180
        return place and (self.latitude, self.longitude) != (0, 0)


def decode_srt(data: bytes) -> str:
    """A file's text: UTF-16 where it begins with that mark, else UTF-8."""
    is_utf16 = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    text = data.decode("utf-16" if is_utf16 else "utf-8-sig", errors="replace")
    return text.replace("\r\n", "\n")


def begins_srt(head: bytes) -> bool:
    """Whether a file that begins so holds subtitles."""
    return bool(_START.match(decode_srt(head)))


def parse_srt(text: str) -> Iterator[Subtitle]:
    """The subtitles of a file, whichever of DJI's styles it is in."""
    for one, said in _split(text):
        number, hours, minutes, seconds = map(int, one.groups()[:4])
        begin_s = 60 * (60 * hours + minutes) + seconds
        begin_ns = begin_s * _NS + int(one[5].ljust(3, "0")) * 1_000_000
        yield _parse(number, begin_ns, said)


def ends_cut(text: str) -> bool:
    """Whether the last subtitle says only a part of what others say, or more than text."""
    *others, last = (_form(said) for _, said in _split(text))
    if _NO_TEXT.search(last):
        return True
    return last not in others and any(
        whole.startswith(last) or last.startswith(f"{whole}\n") for whole in set(others)
    )


def _form(said: str) -> str:
    """What it says but for its figures and blanks."""
    return re.sub(r"\s*\n\s*", "\n", _FIGURES.sub("0", said)).strip()


def _split(text: str) -> Iterator[tuple[re.Match[str], str]]:
    """Each subtitle's number and times, and what it says."""
    for one, following in pairwise(chain(_SUBTITLE.finditer(text), [None])):
        assert one is not None
        yield one, text[one.end() : following.start() if following else None]


def _parse(number: int, begin_ns: int, text: str) -> Subtitle:
    latitude, longitude = _place(text)
    date_ns, is_fine = _date(text)
    return Subtitle(
        number,
        begin_ns,
        date_ns,
        is_fine,
        latitude,
        longitude,
        _number(_ABSOLUTE, text),
        _number(_RELATIVE, text),
    )


def _place(text: str) -> tuple[float, float]:
    """Latitude and longitude; ``GPS(...)`` has the longitude first, but not in all models."""
    pair = _GPS.search(text)
    if pair is None:
        return _number(_LATITUDE, text), _number(_LONGITUDE, text)
    longitude, latitude = float(pair[1]), float(pair[2])
    return (longitude, latitude) if abs(latitude) > 90 else (latitude, longitude)


def _number(pattern: re.Pattern[str], text: str) -> float:
    found = pattern.search(text)
    return float(next(filter(None, found.groups()))) if found else math.nan


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


_FRAME = "gps"
_FIX, _NO_FIX = 0, -1


def open_srt(path: str | Path) -> SeriesRecording:
    """Open a file of subtitles; those without a place become fixes whose status is that of none.

    Raises:
        OpenError: nothing in it says a place, or it is too large.
    """
    path = Path(path)
    try:
        check_text(path.stat().st_size)
    except TooLarge as error:
        raise OpenError(f"{path}: {error}") from None
    data = read_file(path)
    text = decode_srt(data)
    subtitles = list(parse_srt(text))
    if not any(one.has_fix for one in subtitles):
        raise OpenError(f"{path}: no places in these subtitles; DJI's have them if GPS was on")
    stamps_ns, clock, notes = _stamps_ns(subtitles)
    altitudes, more_notes = _altitudes(subtitles)

    def fix(index: int) -> NavSatFix:
        one, header = subtitles[index], Header(int(stamps_ns[index]), _FRAME)
        status = _FIX if one.has_fix else _NO_FIX
        return NavSatFix(
            one.latitude, one.longitude, altitudes[index], status=status, header=header
        )

    series = [Series("/gps/fix", NavSatFix, stamps_ns, fix)]
    notes += more_notes
    loss = _loss(subtitles, ends_cut(text))
    return SeriesRecording(path, f"DJI SRT ({clock})", len(data), series, notes, loss=loss)


def _stamps_ns(subtitles: Sequence[Subtitle]) -> tuple[npt.NDArray[np.int64], str, list[str]]:
    """Their times, by which clock, and what is to be said of it.

    Dates of whole seconds, and those that go back, only say when the film began.
    """
    dates_ns = [one.date_ns for one in subtitles if one.date_ns is not None]
    notes: list[str] = []
    if len(dates_ns) == len(subtitles) and all(one.date_is_fine for one in subtitles):
        if not (back := _count_back(dates_ns)):
            return np.array(dates_ns, np.int64), "camera's clock", notes
        notes.append(
            f"the camera's clock goes back {_times(back)}: stamps go by the time in the film"
        )
    began_ns = next((one.date_ns - one.begin_ns for one in subtitles if one.date_ns is not None), 0)
    stamps_ns = [began_ns + one.begin_ns for one in subtitles]
    if back := _count_back(stamps_ns):
        notes.append(f"the time in the film goes back {_times(back)}: fixes are sorted by it")
    clock = "camera's clock" if dates_ns else "time in the film"
    return np.array(stamps_ns, np.int64), clock, notes


def _count_back(times_ns: Sequence[int]) -> int:
    return sum(b < a for a, b in pairwise(times_ns))


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _altitudes(subtitles: Sequence[Subtitle]) -> tuple[list[float], list[str]]:
    """One kind of altitude for all, and what is to be said of it."""
    if any(math.isfinite(one.altitude) for one in subtitles):
        return [one.altitude for one in subtitles], []
    heights = [one.height for one in subtitles]
    if any(map(math.isfinite, heights)):
        return heights, ["altitudes are above where it took off: it says no others"]
    return heights, ["it says no altitudes"]


def _loss(subtitles: Sequence[Subtitle], is_cut: bool) -> Loss:
    numbers = [one.number for one in subtitles]
    loss = Loss(sum(max(0, b - a - 1) for a, b in pairwise(numbers)))
    if loss.messages:
        loss.notes.append(f"{loss.messages} subtitles are missing or damaged")
    if is_cut:
        loss.notes.append("cut off within the last subtitle")
    return loss

"""The subtitles (``.SRT``) beside the films of DJI's drones as recordings: ``/gps/fix``.

Stamps are by the camera's clock, which shows its local time and is taken for UTC, where the
subtitles have dates; else they are the time in the film. Where that clock goes back, the film began
at its first date. Altitudes are those above the sea where the subtitles say them, else above where
the drone took off. What they say of the camera is left out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import OpenError, TooLarge
from ros_visualise.core.limits import check_text
from ros_visualise.core.regular_files import read_file
from ros_visualise.data import Header, NavSatFix
from ros_visualise.sources.logs.srt import Subtitle, decode_srt, ends_cut, parse_srt
from ros_visualise.sources.recordings import Loss
from ros_visualise.sources.recordings.series import SeriesRecording
from ros_visualise.sources.series import Series

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

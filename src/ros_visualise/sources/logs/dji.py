"""The subtitles (``.SRT``) beside the films of DJI's drones as recordings: ``/gps/fix``.

Stamps are by the camera's clock, which shows its local time and is taken for UTC, where the
subtitles have dates; else they are the time in the film. Altitudes are those above the sea where
the subtitles say them, else above where the drone took off. What they say of the camera is left
out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Header, NavSatFix
from ros_visualise.errors import OpenError
from ros_visualise.sources.logs.srt import Subtitle, parse_srt
from ros_visualise.sources.recordings.series import SeriesRecording
from ros_visualise.sources.series import Series

_FRAME = "gps"
_FIX, _NO_FIX = 0, -1


def open_srt(path: str | Path) -> SeriesRecording:
    """Open a file of subtitles; those without a place become fixes whose status is that of none.

    Raises:
        OpenError: nothing in it says a place.
    """
    path = Path(path)
    data = path.read_bytes()
    text = data.decode("utf-8-sig", errors="replace").replace("\r\n", "\n")
    subtitles = list(parse_srt(text))
    if not any(one.has_fix for one in subtitles):
        raise OpenError(f"{path}: no places in these subtitles; DJI's have them if GPS was on")
    stamps_ns, clock = _stamps_ns(subtitles)
    altitudes, notes = _altitudes(subtitles)

    def fix(index: int) -> NavSatFix:
        one, header = subtitles[index], Header(int(stamps_ns[index]), _FRAME)
        status = _FIX if one.has_fix else _NO_FIX
        return NavSatFix(
            one.latitude, one.longitude, altitudes[index], status=status, header=header
        )

    series = [Series("/gps/fix", NavSatFix, stamps_ns, fix)]
    recording = SeriesRecording(path, f"DJI SRT ({clock})", len(data), series, notes)
    recording.loss.notes += _lost(subtitles, recording)
    return recording


def _stamps_ns(subtitles: Sequence[Subtitle]) -> tuple[npt.NDArray[np.int64], str]:
    """Their times, and by which clock. Dates of whole seconds say when the film began alone."""
    dates_ns = [one.date_ns for one in subtitles if one.date_ns is not None]
    if len(dates_ns) == len(subtitles) and all(one.date_is_fine for one in subtitles):
        return np.array(dates_ns, np.int64), "camera's clock"
    dated = next((one for one in subtitles if one.date_ns is not None), None)
    began_ns = 0 if dated is None or dated.date_ns is None else dated.date_ns - dated.begin_ns
    stamps_ns = np.array([began_ns + one.begin_ns for one in subtitles], np.int64)
    return stamps_ns, "time in the film" if dated is None else "camera's clock"


def _altitudes(subtitles: Sequence[Subtitle]) -> tuple[list[float], list[str]]:
    """One kind of altitude for all, and what is to be said of it."""
    if any(math.isfinite(one.altitude) for one in subtitles):
        return [one.altitude for one in subtitles], []
    heights = [one.height for one in subtitles]
    if any(map(math.isfinite, heights)):
        return heights, ["altitudes are above where it took off: it says no others"]
    return heights, ["it says no altitudes"]


def _lost(subtitles: Sequence[Subtitle], recording: SeriesRecording) -> list[str]:
    numbers = [one.number for one in subtitles]
    missing = sum(max(0, b - a - 1) for a, b in pairwise(numbers))
    recording.loss.messages += missing
    notes = [f"{missing} subtitles are missing or damaged"] if missing else []
    if not subtitles[-1].has_fix and all(one.has_fix for one in subtitles[:-1]):
        notes.append("cut off within the last subtitle")
    return notes

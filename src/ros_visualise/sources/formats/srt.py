"""Subtitles of DJI's cameras, with their GPS positions."""

from __future__ import annotations

from pathlib import Path

from ros_visualise.sources.formats import Format
from ros_visualise.sources.logs.dji import begins_srt
from ros_visualise.sources.recordings import Recording


def _open(path: Path) -> Recording:
    from ros_visualise.sources.logs.dji import open_srt

    return open_srt(path)


FORMAT = Format("DJI subtitle file", _open, suffixes=(".srt",), begins=begins_srt)

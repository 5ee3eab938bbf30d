"""Subtitles of DJI's cameras, with their GPS positions."""

from __future__ import annotations

from ros_visualise.sources.formats import Format, lazily

FORMAT = Format(
    "DJI subtitle file",
    lazily("logs.dji:open_srt"),
    suffixes=(".srt",),
    begins=lazily("logs.dji:begins_srt"),
)

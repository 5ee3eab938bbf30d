"""Tracks in GPX files."""

from __future__ import annotations

from ros_visualise.sources.formats import Format, lazily

FORMAT = Format(
    "GPX track",
    lazily("logs.positions:open_gpx"),
    suffixes=(".gpx",),
    begins=lazily("logs.positions:begins_gpx"),
)

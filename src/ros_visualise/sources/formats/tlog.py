"""Telemetry logs of ground stations."""

from __future__ import annotations

from ros_visualise.sources.formats import Format, lazily

FORMAT = Format(
    "telemetry log (MAVLink)",
    lazily("logs.tlog:open_tlog"),
    suffixes=(".tlog",),
    begins=lazily("logs.tlog:begins_tlog"),
)

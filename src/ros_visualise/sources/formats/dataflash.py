"""Flight logs of ArduPilot."""

from __future__ import annotations

from ros_visualise.sources.formats import Format, lazily

FORMAT = Format(
    "ArduPilot flight log (DataFlash)",
    lazily("logs.ardupilot:open_dataflash"),
    suffixes=(".bin",),
    begins=lambda head: head.startswith(b"\xa3\x95\x80\x80\x59"),
)

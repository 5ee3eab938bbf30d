"""MCAP files."""

from __future__ import annotations

from ros_visualise.sources.formats import Format, lazily

FORMAT = Format(
    "MCAP file",
    lazily("recordings.mcap_file:open_mcap"),
    suffixes=(".mcap",),
    begins=lambda head: head.startswith(b"\x89MCAP0\r\n"),
)

"""MCAP files."""

from __future__ import annotations

from pathlib import Path

from ros_visualise.sources.formats import Format
from ros_visualise.sources.recordings import Recording


def _open(path: Path) -> Recording:
    from ros_visualise.sources.recordings.mcap_file import open_mcap

    return open_mcap(path)


FORMAT = Format(
    "MCAP file",
    _open,
    suffixes=(".mcap",),
    begins=lambda head: head.startswith(b"\x89MCAP0\r\n"),
)

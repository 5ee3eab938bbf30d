"""Flight logs of PX4."""

from __future__ import annotations

from pathlib import Path

from ros_visualise.sources.formats import Format
from ros_visualise.sources.recordings import Recording


def _open(path: Path) -> Recording:
    from ros_visualise.sources.logs.px4 import open_ulog

    return open_ulog(path)


FORMAT = Format(
    "PX4 flight log (ULog)",
    _open,
    suffixes=(".ulg",),
    begins=lambda head: head.startswith(b"ULog\x01\x12\x35"),
)

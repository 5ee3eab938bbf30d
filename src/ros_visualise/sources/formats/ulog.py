"""Flight logs of PX4."""

from __future__ import annotations

from ros_visualise.sources.formats import Format, lazily

FORMAT = Format(
    "PX4 flight log (ULog)",
    lazily("logs.px4:open_ulog"),
    suffixes=(".ulg",),
    begins=lambda head: head.startswith(b"ULog\x01\x12\x35"),
)

"""Tables of positions, such as AirData's."""

from __future__ import annotations

from ros_visualise.sources.formats import Format, lazily

FORMAT = Format(
    "table of positions",
    lazily("logs.positions:open_positions"),
    suffixes=(".csv",),
    begins=lazily("logs.positions:begins_positions"),
)

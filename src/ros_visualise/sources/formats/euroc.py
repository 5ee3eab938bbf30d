"""Sequences of EuRoC and TUM-VI, in the format of ETH's ASL."""

from __future__ import annotations

from ros_visualise.sources.formats import Format, lazily

FORMAT = Format(
    "EuRoC folder",
    lazily("euroc:open_euroc"),
    is_folder=lazily("euroc:is_whole"),
    whole_of=lazily("euroc:find_whole"),
)

"""``convert``: a recording in another format, or a part of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from ros_visualise.commands import Command
from ros_visualise.running.arguments import argument, not_negative, option, positive
from ros_visualise.running.options import MemoryOptions


@dataclass(frozen=True, kw_only=True)
class ConvertOptions(MemoryOptions):
    """Options of ``convert``."""

    input: Sequence[str] = argument(
        "the recording or video; several are merged", metavar="SRC", nargs="+"
    )
    output: str = argument(
        "the new file: .bag or .mcap, .mp4 for one image topic, .csv for numbers, .txt for"
        " tracks (MOT format); a name without a suffix makes a ROS 2 folder",
        metavar="DST",
    )
    offset: Sequence[str] = option(
        [],
        "shift one of several recordings in time (positive: later); auto aligns a video with a"
        " gyroscope by comparing their motion; repeatable",
        metavar="NAME=SECONDS|auto",
    )
    topics: Sequence[str] = option(
        [], "write only these topics", action="extend", nargs="+", metavar="TOPIC"
    )
    start: float | None = option(None, "skip the first S seconds", type=not_negative, metavar="S")
    duration: float | None = option(None, "write only S seconds", type=positive, metavar="S")
    between: Sequence[str] = option(
        [],
        "write only the part between two marks that were set on the page",
        action="store",
        nargs=2,
        metavar="MARK",
    )
    compression: str | None = option(
        None,
        "for a .bag: none (default), lz4 or bz2; for .mcap and ROS 2: auto (default; zstd"
        " for small messages, lz4 for images), none, lz4 or zstd",
        choices=("auto", "none", "lz4", "bz2", "zstd"),
    )
    profile: Literal["ros1", "ros2"] | None = option(
        None,
        "message types in an .mcap: ros2 (default), or ros1, which copies the messages of a .bag"
        " unchanged",
        choices=("ros1", "ros2"),
    )
    overwrite: bool = option(False, "replace DST if it exists")
    json: bool = option(False, "print a report as one JSON object")


COMMAND = Command(
    "write a recording, or a part of it, in another format",
    ConvertOptions,
    "ros_visualise.commands.convert.work:convert",
)

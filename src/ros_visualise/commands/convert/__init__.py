"""``convert``: a recording in another format, or a part of it."""

from __future__ import annotations

from argparse import ArgumentParser
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ros_visualise.commands import Command
from ros_visualise.running.argument_types import not_negative, positive
from ros_visualise.running.options import MemoryOptions, add_memory_option

if TYPE_CHECKING:
    from ros_visualise.sinks import Profile


@dataclass(frozen=True, kw_only=True)
class ConvertOptions(MemoryOptions):
    """Options of ``convert``."""

    input: str
    output: str
    topics: Sequence[str]
    start: float | None
    duration: float | None
    compression: str | None
    profile: Profile | None
    overwrite: bool
    json: bool


def add_arguments(parser: ArgumentParser) -> None:
    """Which part of a recording, and how it is written."""
    parser.add_argument("input", metavar="SRC", help="the recording, of any kind")
    parser.add_argument(
        "output",
        metavar="DST",
        help="the new file, a .bag or .mcap; a name without either ending makes a ROS 2 folder",
    )
    parser.add_argument(
        "--topics",
        action="extend",
        nargs="+",
        default=[],
        metavar="TOPIC",
        help="only these topics",
    )
    parser.add_argument(
        "--start", type=not_negative, metavar="S", help="leave out the first S seconds"
    )
    parser.add_argument("--duration", type=positive, metavar="S", help="take only S seconds")
    parser.add_argument(
        "--compression",
        choices=("auto", "none", "lz4", "bz2", "zstd"),
        help="for a .bag: none (default), lz4 or bz2; for .mcap and ROS 2: auto (default; zstd"
        " for small messages, lz4 for images), none, lz4 or zstd",
    )
    parser.add_argument(
        "--profile",
        choices=("ros1", "ros2"),
        help="message types of an .mcap: ros2 (default), or ros1, which keeps a .bag's bytes",
    )
    parser.add_argument("--overwrite", action="store_true", help="replace DST if it exists")
    parser.add_argument("--json", action="store_true", help="print a report as one JSON object")
    add_memory_option(parser)


def run(options: ConvertOptions) -> int:
    """Copy a recording into a new file, and report what was lost."""
    from ros_visualise.commands.convert.work import convert

    return convert(options)


COMMAND = Command(
    "write a recording, or a part of it, in another format", add_arguments, ConvertOptions, run
)

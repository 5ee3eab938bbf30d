"""Options that commands share: groups of them, each a dataclass with what adds it to a parser.

A command's options are a frozen dataclass too, with a field for each argument; it inherits from
the groups that the command has. Light to import.
"""

from __future__ import annotations

from argparse import ArgumentParser, BooleanOptionalAction
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ros_visualise.core.limits import DEFAULT_MEMORY
from ros_visualise.core.rate import MAX_RATE
from ros_visualise.running.argument_types import (
    count,
    folder,
    memory,
    not_negative,
    port,
    positive,
    rate,
    seed,
)
from ros_visualise.simulation.worlds import OURS


@dataclass(frozen=True, kw_only=True)
class MemoryOptions:
    """How much memory an input may take."""

    max_memory: int


def add_memory_option(parser: ArgumentParser) -> None:
    """How much memory an input may take, for each command that reads one."""
    parser.add_argument(
        "--max-memory",
        type=memory,
        default=DEFAULT_MEMORY,
        metavar="SIZE",
        help=f"memory that one input may take, such as 4G (default: {DEFAULT_MEMORY >> 30}G)",
    )


@dataclass(frozen=True, kw_only=True)
class WorldOptions:
    """Where a simulated robot is, and what it does."""

    world: str | None
    seed: int | None
    mission: str | None


def add_world_options(parser: Any, without_mission: str) -> None:
    """Where a simulated robot is, and what it does; by default that, in words."""
    parser.add_argument(
        "--world", default="field", help=f"{OURS}, or one of another package (default: field)"
    )
    parser.add_argument(
        "--seed", type=seed, default=0, help="seed of all random errors (default: 0)"
    )
    parser.add_argument(
        "--mission",
        metavar="SHAPE|FILE",
        help="what the robot is to do: square, figure_of_eight, lawn_mower, default or a YAML file"
        f" (default: {without_mission})",
    )


@dataclass(frozen=True, kw_only=True)
class ViewingOptions:
    """How it is shown."""

    view: str
    host: str
    port: int
    token: bool
    open: bool | None
    layout: Path | None
    urdf: Path | None
    allow_origin: Sequence[str]


def _add_viewing(parser: ArgumentParser) -> None:
    group = parser.add_argument_group("viewing")
    group.add_argument(
        "--view",
        choices=("web", "windows", "none"),
        default="web",
        help="show a web page (default), OpenCV windows, or nothing",
    )
    group.add_argument(
        "--host",
        default="127.0.0.1",
        help="address that the page listens on (default: %(default)s)",
    )
    group.add_argument(
        "--port", type=port, default=8080, help="port of the page (default: %(default)s)"
    )
    group.add_argument(
        "--no-token",
        dest="token",
        action="store_false",
        help="let everybody who reaches the page use it (default: its address holds a token)",
    )
    group.add_argument(
        "--open",
        action=BooleanOptionalAction,
        help="open the page in a browser (default: from a terminal on a desktop)",
    )
    group.add_argument(
        "--layout",
        type=Path,
        metavar="FILE.yaml",
        help="arrange the page as this file says; 'save layout' on the page writes one",
    )
    group.add_argument(
        "--urdf",
        type=Path,
        metavar="FILE",
        help="draw this robot in place of the one on /robot_description",
    )
    group.add_argument(
        "--allow-origin",
        action="append",
        default=[],
        metavar="SITE",
        help="allow this web site to use the page, such as https://robot.example.org; repeatable",
    )


@dataclass(frozen=True, kw_only=True)
class PartOptions:
    """Which part of the source."""

    start: float | None
    duration: float | None
    frames: int | None


def add_part(group: Any) -> None:
    """Which part of the source."""
    group.add_argument(
        "--start", type=not_negative, metavar="S", help="leave out the first S seconds"
    )
    group.add_argument("--duration", type=positive, metavar="S", help="stop after S seconds")
    group.add_argument("--frames", type=count, metavar="N", help="stop after N images")


@dataclass(frozen=True, kw_only=True)
class PaceOptions(PartOptions):
    """How fast, and which part of the source."""

    rate: float | None
    loop: bool
    paused: bool = False
    """Whether it begins so; no argument."""


def _add_pace(parser: ArgumentParser) -> None:
    group = parser.add_argument_group("playing")
    group.add_argument(
        "--rate",
        type=rate,
        help=f"playback speed, up to {MAX_RATE} (default: 1); 0: as fast as possible without loss",
    )
    group.add_argument("--loop", action="store_true", help="start again at the end")
    add_part(group)


@dataclass(frozen=True, kw_only=True)
class SettingOptions:
    """Parameters of nodes."""

    set: Sequence[str]
    params: Path | None


def add_settings(group: Any) -> None:
    """Parameters of nodes."""
    group.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NODE.PARAM=VALUE",
        help="set a parameter of a node; `ros-visualise nodes` lists them; repeatable",
    )
    group.add_argument(
        "--params",
        type=Path,
        metavar="FILE.yaml",
        help="set parameters from a file; 'save parameters' on the page writes one",
    )


@dataclass(frozen=True, kw_only=True)
class NodeOptions(SettingOptions):
    """Which nodes there are beside those of the source, and their parameters."""

    landmarks: bool | None
    preset: str
    navigate: str | None
    node: Sequence[str]


def _add_nodes(parser: ArgumentParser) -> None:
    group = parser.add_argument_group("nodes")
    group.add_argument(
        "--landmarks",
        action=BooleanOptionalAction,
        help="find tags in the images, and map them where the camera's pose is known (default:"
        " on for simulated robots only)",
    )
    preset = group.add_argument(
        "--preset",
        default="",
        metavar="NAME",
        help="set the image nodes together: default, seed, soft, strong, automatic, gradient "
        "or 'black and white'",
    )
    preset.completer = _presets  # type: ignore[attr-defined]  # of argcomplete
    group.add_argument(
        "--navigate",
        nargs="?",
        const="",
        metavar="MAP.yaml",
        help="find out where the robot is by the tags that it sees, with a saved map, or "
        "building a new one",
    )
    add_settings(group)
    group.add_argument(
        "--node",
        action="append",
        default=[],
        metavar="NODE[@AFTER][,INPUT=TOPIC]",
        help="add a node: a built-in one, or your own as FILE.py:NAME; AFTER names the node "
        "whose output it takes (default: filters, or else the source); repeatable",
    )


def _presets(**_: object) -> tuple[str, ...]:
    from ros_visualise.graph.presets import NAMES

    return NAMES


@dataclass(frozen=True, kw_only=True)
class OutputOptions:
    """What is written."""

    record: Sequence[str]
    split: str | None
    record_dir: Path
    overwrite: bool
    json: bool


def _add_output(parser: ArgumentParser) -> None:
    group = parser.add_argument_group("output")
    group.add_argument(
        "--record",
        action="append",
        default=[],
        metavar="OUT[@TOPIC,...]",
        help="record to an .mcap, a .bag or a ROS 2 folder, or one topic of images to an .mp4 "
        "(default: /edges); repeatable",
    )
    group.add_argument(
        "--split",
        metavar="SIZE|TIME",
        help="begin another file of a recording after so much, such as 1G or 10m",
    )
    group.add_argument(
        "--record-dir",
        type=folder,
        default=Path(),
        metavar="DIR",
        help="folder of the files that the page reads and writes (default: the current one)",
    )
    group.add_argument(
        "--overwrite",
        action="store_true",
        help="replace existing recordings, maps and calibrations, each as soon as the new one is"
        " complete",
    )
    group.add_argument(
        "--json", action="store_true", help="print a report of the run as JSON at the end"
    )


@dataclass(frozen=True, kw_only=True)
class PlayingOptions(ViewingOptions, PaceOptions, NodeOptions, OutputOptions, MemoryOptions):
    """Options of a command that plays a source through nodes."""


def add_playing_options(parser: ArgumentParser) -> None:
    """All that can be asked of a command that plays a source through nodes."""
    _add_viewing(parser)
    _add_pace(parser)
    _add_nodes(parser)
    _add_output(parser)
    add_memory_option(parser)


def add_size_option(parser: ArgumentParser) -> None:
    """To which size the images of a source are scaled."""
    parser.add_argument("--size", metavar="WxH", default="", help="scale the images to this size")

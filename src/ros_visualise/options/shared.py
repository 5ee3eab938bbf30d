"""What the playing commands share on the command line, and the values that options take."""

from __future__ import annotations

import math
from argparse import ArgumentParser, ArgumentTypeError, BooleanOptionalAction
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ros_visualise.errors import UsageError
from ros_visualise.limits import DEFAULT_MEMORY, MAX_TAG_M, parse_memory
from ros_visualise.rate import MAX_RATE
from ros_visualise.simulation.worlds import OURS

_MAX_S = 1e9  # thirty years; with more, stamps are beyond what ROS holds


def _checked(
    kind: type[int] | type[float], accept: Callable[[float], bool], words: str
) -> Callable[[str], float]:
    def parse(text: str) -> float:
        try:
            number = kind(text)
        except ValueError:
            number = math.nan
        if not accept(number):
            raise ArgumentTypeError(f"{text!r} is not {words}")
        return number

    return parse


not_negative = _checked(float, lambda n: 0 <= n <= _MAX_S, f"a number from 0 to {_MAX_S:g}")
positive = _checked(float, lambda n: 0 < n <= _MAX_S, f"a number above 0, to {_MAX_S:g}")
tag_size = _checked(float, lambda n: 0 < n <= MAX_TAG_M, f"a number above 0, to {MAX_TAG_M:g}")
_seed = _checked(int, lambda n: 0 <= n < 2**31, "a whole number from 0 to 2147483647")
_rate = _checked(float, lambda n: 0 <= n <= MAX_RATE, f"a number from 0 to {MAX_RATE}")
_count = _checked(int, lambda n: n >= 1, "a whole number of at least 1")
_port = _checked(int, lambda n: 1 <= n <= 65535, "a port from 1 to 65535")


def _memory(text: str) -> int:
    try:
        return parse_memory(text)
    except UsageError as error:
        raise ArgumentTypeError(str(error)) from None


def _folder(text: str) -> Path:
    if not text:
        raise ArgumentTypeError("give the name of a folder; . is the current one")
    return Path(text)


def add_memory_option(parser: ArgumentParser) -> None:
    """How much memory an input may take, for each command that reads one."""
    parser.add_argument(
        "--max-memory",
        type=_memory,
        default=DEFAULT_MEMORY,
        metavar="SIZE",
        help=f"memory that one input may take, such as 4G (default: {DEFAULT_MEMORY >> 30}G)",
    )


MISSION = "what the robot is to do: square, figure_of_eight, lawn_mower, default or a YAML file"


def add_world_options(parser: Any) -> None:
    """Where a simulated robot is."""
    parser.add_argument(
        "--world",
        default="field",
        help=f"{OURS}, or one of another package (default: %(default)s)",
    )
    parser.add_argument(
        "--seed", type=_seed, default=0, help="seed of all random errors (default: 0)"
    )


def add_playing_options(parser: ArgumentParser) -> None:
    """All that can be asked of a command that plays a source through nodes."""
    _add_viewing(parser)
    _add_pace(parser)
    _add_nodes(parser)
    _add_output(parser)
    add_memory_option(parser)


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
        "--port", type=_port, default=8080, help="port of the page (default: %(default)s)"
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
        "--allow-origin",
        action="append",
        default=[],
        metavar="SITE",
        help="allow this web site to use the page, such as https://robot.example.org; repeatable",
    )


def _add_pace(parser: ArgumentParser) -> None:
    group = parser.add_argument_group("playing")
    group.add_argument(
        "--rate",
        type=_rate,
        help=f"playback speed, up to {MAX_RATE} (default: 1); 0: as fast as possible without loss",
    )
    group.add_argument("--loop", action="store_true", help="start again at the end")
    add_part(group)


def add_part(group: Any) -> None:
    """Which part of the source."""
    group.add_argument(
        "--start", type=not_negative, metavar="S", help="leave out the first S seconds"
    )
    group.add_argument("--duration", type=positive, metavar="S", help="stop after S seconds")
    group.add_argument("--frames", type=_count, metavar="N", help="stop after N images")


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
    from ros_visualise.presets import NAMES

    return NAMES


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
        type=_folder,
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

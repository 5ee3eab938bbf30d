"""``trajectory``: trajectories, drawn, written as text, and compared with the truth."""

from __future__ import annotations

import re
from argparse import ArgumentParser, ArgumentTypeError
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ros_visualise.commands import Command
from ros_visualise.running.argument_types import not_negative
from ros_visualise.running.options import MemoryOptions, add_memory_option


@dataclass(frozen=True, kw_only=True)
class TrajectoryOptions(MemoryOptions):
    """Options of ``trajectory``."""

    input: str
    output: Path | None
    topic: Sequence[str]
    beside: Sequence[str]
    truth: str | None
    align: str
    max_difference: float
    delta: tuple[float, str]
    format: str
    plot: Path | None
    plane: str
    overwrite: bool
    json: bool


def add_arguments(parser: ArgumentParser) -> None:
    """Which trajectories, what they are compared with, and what is written."""
    parser.add_argument(
        "input",
        metavar="SRC",
        help="a recording of any kind, or a text file in the format of TUM or KITTI",
    )
    parser.add_argument(
        "output",
        metavar="OUT",
        nargs="?",
        type=Path,
        help="text file to write the trajectory to (as --align moved it); without OUT it is "
        "drawn in the terminal",
    )
    parser.add_argument(
        "--topic",
        action="append",
        default=[],
        help="topic of poses, odometry, fixes or a path, or two frames as /tf:PARENT.CHILD;"
        " repeatable",
    )
    parser.add_argument(
        "--with",
        dest="beside",
        action="append",
        default=[],
        metavar="FILE[@TOPIC,...]",
        help="another text file or recording; repeatable",
    )
    _add_comparing(parser.add_argument_group("comparing"))
    _add_output(parser.add_argument_group("output"))
    add_memory_option(parser)


def _add_comparing(group: Any) -> None:
    group.add_argument(
        "--truth",
        metavar="TOPIC|FILE[@TOPIC]",
        help="the true trajectory: print the errors ATE and RPE, as evo does",
    )
    group.add_argument(
        "--align",
        choices=("none", "origin", "se3", "sim3"),
        default="none",
        help="move the trajectory onto the truth first: by the first poses (origin), by all "
        "positions (se3), also with a scale (sim3) (default: %(default)s)",
    )
    group.add_argument(
        "--max-difference",
        type=not_negative,
        default=0.01,
        metavar="S",
        help="compare poses whose stamps differ by at most S seconds (default: %(default)s)",
    )
    group.add_argument(
        "--delta",
        type=_delta,
        default="1f",
        metavar="N",
        help="how far apart the two poses are that RPE compares: 1f (from one pose to the "
        "next), 10m, 5deg, 1s (default: %(default)s)",
    )


def _add_output(group: Any) -> None:
    group.add_argument(
        "--format",
        choices=("tum", "kitti"),
        default="tum",
        help="format of OUT (default: %(default)s)",
    )
    group.add_argument(
        "--plot", type=Path, metavar="FILE", help="draw the trajectories to this .png or .svg"
    )
    group.add_argument(
        "--plane",
        choices=("auto", "xy", "xz", "yz", "all"),
        default="auto",
        help="the plane to draw (default: the one in which the robot moves, or all three if "
        "there is none)",
    )
    group.add_argument("--overwrite", action="store_true", help="replace existing files")
    group.add_argument("--json", action="store_true", help="print a report as one JSON object")


def _delta(text: str) -> tuple[float, str]:
    """How much of which of `geometry.trajectory_errors.DELTA_UNITS`."""
    found = re.fullmatch(r"(\d{1,9}(?:\.\d{1,9})?)(f|m|deg|s)", text)
    amount = float(found[1]) if found else 0.0
    if found is None or amount <= 0 or (found[2] == "f" and not amount.is_integer()):
        raise ArgumentTypeError(f"{text!r}: give poses as 1f, or 10m, 5deg, 1s")
    return amount, found[2]


def run(options: TrajectoryOptions) -> int:
    """Read trajectories, compare them, write and draw them, and print what they are."""
    from ros_visualise.commands.trajectory.work import assess

    return assess(options)


COMMAND = Command(
    "draw poses, compare them with the truth (ATE, RPE), write them for evo",
    add_arguments,
    TrajectoryOptions,
    run,
)

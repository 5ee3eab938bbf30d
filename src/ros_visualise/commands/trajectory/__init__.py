"""``trajectory``: trajectories, drawn, written as text, and compared with the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ros_visualise.commands import Command
from ros_visualise.running.arguments import argument, not_negative, option, plot_width
from ros_visualise.running.options import MemoryOptions


@dataclass(frozen=True, kw_only=True)
class ComparisonOptions:
    """Options of the comparison."""

    GROUP = "comparing"

    truth: str | None = option(
        None,
        "the true trajectory; if given, ATE and RPE are reported, computed as in evo",
        metavar="TOPIC|FILE[@TOPIC]",
    )
    align: str = option(
        "none",
        "first align the trajectory with the truth: by the first poses (origin), by all"
        " positions (se3), or also with a scale (sim3) (default: %(default)s)",
        choices=("none", "origin", "se3", "sim3"),
    )
    max_difference: float = option(
        0.01,
        "compare poses whose stamps differ by at most S seconds (default: %(default)s)",
        type=not_negative,
        metavar="S",
    )
    delta: str = option(
        "1f",
        "spacing of the two poses that RPE compares: 1f (from one pose to the next), "
        "10m, 5deg, 1s (default: %(default)s)",
        metavar="N",
    )


@dataclass(frozen=True, kw_only=True)
class TrajectoryOutputOptions:
    """Options of files and plots."""

    GROUP = "output"

    format: str = option("tum", "format of OUT (default: %(default)s)", choices=("tum", "kitti"))
    plot: Path | None = option(
        None, "draw the trajectories to this .png, .svg or .pdf", metavar="FILE"
    )
    width: float = option(
        210, "width of the plot in mm; 88 fits one column (default: %(default)s)", type=plot_width
    )
    label: Sequence[str] = option(
        [],
        "name of a trajectory in the legend; repeat the option for each trajectory, in order, with"
        " the ground truth last",
    )
    title: str | None = option(None, "title of the plot; '' for none (default: name and length)")
    plane: str = option(
        "auto",
        "the plane to draw (default: the one in which the robot moves, otherwise all three)",
        choices=("auto", "xy", "xz", "yz", "all"),
    )
    overwrite: bool = option(False, "replace existing files")
    json: bool = option(False, "print a report as one JSON object")


@dataclass(frozen=True, kw_only=True)
class TrajectoryOptions(ComparisonOptions, TrajectoryOutputOptions, MemoryOptions):
    """Options of ``trajectory``."""

    input: str = argument(
        "a recording of any kind, or a text file in the format of TUM, KITTI or EuRoC (CSV)",
        metavar="SRC",
    )
    output: Path | None = argument(
        "text file to write the trajectory to (aligned if --align is given); without OUT it is"
        " drawn in the terminal",
        default=None,
        nargs="?",
        metavar="OUT",
    )
    topic: Sequence[str] = option(
        [],
        "topic with poses, odometry, fixes or a path, or two frames as /tf:PARENT.CHILD;"
        " repeatable",
    )
    beside: Sequence[str] = option(
        [], "another text file or recording; repeatable", flag="--with", metavar="FILE[@TOPIC,...]"
    )


COMMAND = Command(
    "draw trajectories, compare them with the ground truth (ATE, RPE), or write them for evo",
    TrajectoryOptions,
    "ros_visualise.commands.trajectory.work:assess",
)

"""``bag``: a recording of any kind."""

from __future__ import annotations

from argparse import ArgumentParser
from collections.abc import Sequence
from dataclasses import dataclass

from ros_visualise.commands import Command
from ros_visualise.running.options import PlayingOptions, add_playing_options


@dataclass(frozen=True, kw_only=True)
class BagOptions(PlayingOptions):
    """Options of ``bag`` and ``kitti``."""

    input: str
    topics: Sequence[str]
    image: str | None
    odom: str | None


def add_arguments(parser: ArgumentParser) -> None:
    """Which recording, which of its topics, and how they are played."""
    add_playing_options(parser)
    parser.add_argument("input", metavar="PATH", help="the recording")
    add_topic_options(parser)


def add_topic_options(parser: ArgumentParser) -> None:
    """Which topics of a recording, and what is made of them."""
    parser.add_argument(
        "--topics",
        action="extend",
        nargs="+",
        default=[],
        metavar="TOPIC",
        help="play only these topics",
    )
    parser.add_argument(
        "--image",
        metavar="TOPIC|none",
        help="topic whose images go through the nodes (default: the first in gray or colour)",
    )
    parser.add_argument(
        "--odom",
        metavar="TOPIC|none",
        help="topic that the path is drawn from (default: the first odometry), or two frames as"
        " /tf:PARENT.CHILD",
    )


def run(options: BagOptions) -> int:
    """Play the recording."""
    from ros_visualise.running.graphs import recording
    from ros_visualise.running.play import play

    return play(recording(options.input, options.topics, options.image, options.odom), options)


COMMAND = Command(
    "play a recording: .bag, .mcap, a ROS 2 folder, a flight log (.ulg, .SRT)",
    add_arguments,
    BagOptions,
    run,
)

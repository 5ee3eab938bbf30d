"""``kitti``: a drive of the KITTI data set, played as a recording."""

from __future__ import annotations

from argparse import ArgumentParser

from ros_visualise.commands import Command
from ros_visualise.commands.bag import BagOptions, add_topic_options, run
from ros_visualise.running.options import add_playing_options


def add_arguments(parser: ArgumentParser) -> None:
    """Which drive, which of its topics, and how they are played."""
    add_playing_options(parser)
    parser.add_argument(
        "input", metavar="DIR", help="folder of a drive, or of a date with one drive"
    )
    add_topic_options(parser)


COMMAND = Command("play a drive of the KITTI data set", add_arguments, BagOptions, run)

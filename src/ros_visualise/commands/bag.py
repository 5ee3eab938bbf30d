"""``bag``: a recording of any kind."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ros_visualise.commands import Command
from ros_visualise.running.arguments import argument, option
from ros_visualise.running.options import TopicOptions


@dataclass(frozen=True, kw_only=True)
class BagOptions(TopicOptions):
    """Options of ``bag`` and ``kitti``."""

    input: Sequence[str] = argument(
        "the recording; several recordings and videos share one timeline",
        metavar="PATH",
        nargs="+",
    )
    offset: Sequence[str] = option(
        [],
        "shift one of several recordings in time (positive: later); auto aligns a video with a"
        " gyroscope by comparing their motion; repeatable",
        metavar="NAME=SECONDS|auto",
    )


def run(options: BagOptions) -> int:
    """Play the recording."""
    from ros_visualise.running.graphs import recording
    from ros_visualise.running.play import play

    path, *more = options.input
    chosen = (options.topics, options.image, options.odom)
    return play(recording(path, *chosen, more, options.offset), options)


COMMAND = Command(
    "play a recording: .bag, .mcap, a ROS 2 folder, a flight log (.ulg, .bin, .tlog, .SRT)",
    BagOptions,
    run,
)

"""``camera``: a live camera, or a stream."""

from __future__ import annotations

from argparse import ArgumentParser
from typing import TYPE_CHECKING

from ros_visualise.commands import Command
from ros_visualise.commands.video import VideoOptions
from ros_visualise.core.errors import UsageError
from ros_visualise.running.options import add_playing_options, add_size_option

if TYPE_CHECKING:
    from ros_visualise.graph import Graph


def add_arguments(parser: ArgumentParser) -> None:
    """Which camera, and how it is shown."""
    add_playing_options(parser)
    parser.add_argument(
        "input",
        metavar="DEVICE|URL|test",
        nargs="?",
        default="0",
        help="path or number of a device (default: 0), URL of a stream, or test for a test pattern",
    )
    add_size_option(parser)


def run(options: VideoOptions) -> int:
    """Show the camera until it is ended."""
    from ros_visualise.graph.pipelines import image_pipeline
    from ros_visualise.running.graphs import Selection, sized_to
    from ros_visualise.running.play import play

    def graph(_: object) -> Graph:
        if options.rate is not None or options.loop or options.start is not None:
            raise UsageError("a camera is live: it takes no --rate, --loop or --start")
        return image_pipeline("camera", uri=options.input, **sized_to(options.size))

    # the name is not the address, which may hold a password
    return play(Selection("camera", graph, options.input, options.size), options)


COMMAND = Command("show a live camera", add_arguments, VideoOptions, run)

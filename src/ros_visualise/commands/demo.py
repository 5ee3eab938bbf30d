"""``demo``: a simulated robot, or a drawn landscape."""

from __future__ import annotations

from argparse import ArgumentParser
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ros_visualise.commands import Command
from ros_visualise.running.options import PlayingOptions, add_playing_options, add_size_option
from ros_visualise.simulation.robots import ROBOTS

if TYPE_CHECKING:
    from ros_visualise.graph import Graph


@dataclass(frozen=True, kw_only=True)
class DemoOptions(PlayingOptions):
    """Options of ``demo``."""

    scene: str | None
    size: str


def add_arguments(parser: ArgumentParser) -> None:
    """Which scene, and how it is played."""
    add_playing_options(parser)
    parser.add_argument(
        "scene",
        nargs="?",
        choices=(*ROBOTS.builtin, "landscape"),
        help="a simulated robot, or a drawn landscape, which needs no MuJoCo (default: quadrotor)",
    )
    add_size_option(parser)


def run(options: DemoOptions) -> int:
    """Play the scene until it is ended."""
    from ros_visualise.graph.pipelines import demo_pipeline
    from ros_visualise.running.graphs import Selection
    from ros_visualise.running.play import play
    from ros_visualise.sources.video_pixels import parse_size

    def graph(_: object) -> Graph:
        return demo_pipeline(options.scene, parse_size(options.size))

    return play(Selection(options.scene or "demo", graph, size=options.size), options)


COMMAND = Command(
    "play a simulated quadrotor: the quickest way to see it all", add_arguments, DemoOptions, run
)

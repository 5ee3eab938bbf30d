"""``sim``: a simulated robot in a world of its own choice."""

from __future__ import annotations

from argparse import ArgumentParser
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ros_visualise.commands import Command
from ros_visualise.core.errors import UsageError
from ros_visualise.running.options import (
    PlayingOptions,
    WorldOptions,
    add_playing_options,
    add_size_option,
    add_world_options,
)
from ros_visualise.simulation.robots import OURS

if TYPE_CHECKING:
    from ros_visualise.graph import Graph


@dataclass(frozen=True, kw_only=True)
class SimOptions(PlayingOptions, WorldOptions):
    """Options of ``sim``."""

    robot: str
    size: str


def add_arguments(parser: ArgumentParser) -> None:
    """Which robot, where, and how it is played."""
    add_playing_options(parser)
    parser.add_argument("robot", metavar="ROBOT", help=f"{OURS}, or one of another package")
    add_world_options(parser, without_mission="wait for commands")
    add_size_option(parser)


def run(options: SimOptions) -> int:
    """Run the robot until it is ended."""
    from ros_visualise.graph.pipelines import simulation_pipeline
    from ros_visualise.running.graphs import Selection
    from ros_visualise.running.play import play
    from ros_visualise.sources.video_pixels import parse_size

    mission = options.mission or "none"
    is_endless = options.duration is None and options.frames is None

    def graph(_: object) -> Graph:
        if mission == "none" and options.view == "none" and is_endless:
            raise UsageError(
                "the robot has nothing to do and would stand still for ever: add --mission "
                "lawn_mower or --duration 60"
            )
        scenario = {"world": options.world, "mission": mission, "seed": options.seed}
        size = parse_size(options.size)
        return simulation_pipeline(options.robot, size, **scenario)

    return play(Selection(options.robot, graph, size=options.size), options)


COMMAND = Command(f"run a simulated robot: {OURS}", add_arguments, SimOptions, run)

"""``sim``: a simulated robot in a world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ros_visualise.commands import Command
from ros_visualise.core.errors import UsageError
from ros_visualise.running.arguments import argument
from ros_visualise.running.options import SizedOptions, WorldOptions, profile_option
from ros_visualise.simulation.robots import OURS

if TYPE_CHECKING:
    from ros_visualise.graph import Graph


@dataclass(frozen=True, kw_only=True)
class SimOptions(WorldOptions, SizedOptions):
    """Options of ``sim``."""

    robot: str = argument(f"{OURS}, or one from a plug-in", metavar="ROBOT")
    profile: str | None = profile_option("realistic", "realistic")


def run(options: SimOptions) -> int:
    """Run the robot until stopped."""
    from ros_visualise.graph.pipelines import simulation_pipeline
    from ros_visualise.running.graphs import Selection
    from ros_visualise.running.play import play
    from ros_visualise.sources.video_pixels import parse_size

    mission = options.mission or "none"
    is_endless = options.duration is None and options.frames is None

    def graph(_: object) -> Graph:
        if mission == "none" and options.view == "none" and is_endless:
            raise UsageError(
                "without a mission the robot would never move: add --mission lawn_mower"
                " or --duration 60"
            )
        size = parse_size(options.size)
        return simulation_pipeline(options.robot, size, **options.scenario)

    return play(Selection(options.robot, graph, size=options.size), options)


COMMAND = Command(f"run a simulated robot: {OURS}", SimOptions, run)

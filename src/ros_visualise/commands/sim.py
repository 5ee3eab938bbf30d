"""``sim``: a simulated robot in a world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ros_visualise.commands import Command
from ros_visualise.core.errors import UsageError
from ros_visualise.running.arguments import argument, option
from ros_visualise.running.options import SizedOptions, WorldOptions, profile_option
from ros_visualise.simulation.robots import OURS

if TYPE_CHECKING:
    from ros_visualise.graph import Graph


@dataclass(frozen=True, kw_only=True)
class SimOptions(WorldOptions, SizedOptions):
    """Options of ``sim``."""

    robot: str = argument(f"{OURS}, or one from a plug-in", metavar="ROBOT")
    profile: str | None = profile_option("realistic", "realistic")
    mavlink_vehicle: Sequence[str] = option(
        [],
        "present the robot as a PX4 vehicle to ground stations and MAVLink programs at this"
        " address, such as udpout://127.0.0.1:14550 for QGroundControl; repeatable",
        metavar="ADDRESS",
    )


def run(options: SimOptions) -> int:
    """Run the robot until stopped."""
    from ros_visualise.graph.pipelines import simulation_pipeline
    from ros_visualise.graph.vehicles import as_vehicle
    from ros_visualise.running.graphs import Selection
    from ros_visualise.running.play import play
    from ros_visualise.sources.video_pixels import parse_size

    mission = options.mission or "none"
    is_endless = options.duration is None and options.frames is None

    def graph(_: object) -> Graph:
        if options.mavlink_vehicle and options.rate == 0:
            raise UsageError("--mavlink-vehicle runs in real time, so --rate 0 is not allowed")
        waits = mission == "none" and not options.mavlink_vehicle
        if waits and options.view == "none" and is_endless:
            raise UsageError(
                "without a mission the robot would never move: add --mission lawn_mower"
                " or --duration 60"
            )
        size = parse_size(options.size)
        graph = simulation_pipeline(options.robot, size, **options.scenario)
        return as_vehicle(graph, options.mavlink_vehicle)

    return play(Selection(options.robot, graph, size=options.size), options)


COMMAND = Command(f"run a simulated robot: {OURS}", SimOptions, run)

"""``demo``: a simulated robot, or a drawn landscape."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ros_visualise.commands import Command
from ros_visualise.running.arguments import argument
from ros_visualise.running.options import SizedOptions
from ros_visualise.simulation.robots import ROBOTS

if TYPE_CHECKING:
    from ros_visualise.graph import Graph


@dataclass(frozen=True, kw_only=True)
class DemoOptions(SizedOptions):
    """Options of ``demo``."""

    scene: str | None = argument(
        "a simulated robot, or a computer-drawn landscape, which needs no MuJoCo (default:"
        " quadrotor)",
        default=None,
        nargs="?",
        choices=(*ROBOTS.builtin, "landscape"),
    )


def run(options: DemoOptions) -> int:
    """Play the scene until stopped."""
    from ros_visualise.graph.pipelines import demo_pipeline
    from ros_visualise.running.graphs import Selection
    from ros_visualise.running.play import play
    from ros_visualise.sources.video_pixels import parse_size

    def graph(_: object) -> Graph:
        return demo_pipeline(options.scene, parse_size(options.size))

    return play(Selection(options.scene or "demo", graph, size=options.size), options)


COMMAND = Command("play a simulated quadrotor: the quickest way to see it all", DemoOptions, run)

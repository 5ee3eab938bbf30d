"""``camera``: a live camera, or a stream."""

from __future__ import annotations

from dataclasses import dataclass

from ros_visualise.commands import Command
from ros_visualise.core.errors import UsageError
from ros_visualise.running.arguments import argument
from ros_visualise.running.options import SizedOptions


@dataclass(frozen=True, kw_only=True)
class CameraOptions(SizedOptions):
    """Options of ``camera``."""

    input: str = argument(
        'path or number of a device (default: 0), URL of a stream, or "test" (a test pattern)',
        default="0",
        nargs="?",
        metavar="DEVICE|URL|test",
    )


def run(options: CameraOptions) -> int:
    """Show the camera until stopped."""
    from ros_visualise.running.graphs import stream
    from ros_visualise.running.play import play

    if options.rate is not None or options.loop or options.start is not None:
        raise UsageError("--rate, --loop and --start do not apply to a live camera; omit them")
    return play(stream(options.input, options.size), options)


COMMAND = Command("show a live camera", CameraOptions, run)

"""``video``: a film, or a folder of pictures."""

from __future__ import annotations

from dataclasses import dataclass

from ros_visualise.commands import Command
from ros_visualise.running.arguments import argument
from ros_visualise.running.options import SizedOptions


@dataclass(frozen=True, kw_only=True)
class VideoOptions(SizedOptions):
    """Options of ``video``."""

    input: str = argument("any video that FFmpeg can read, or a folder of pictures", metavar="FILE")


def run(options: VideoOptions) -> int:
    """Play the film."""
    from ros_visualise.running.graphs import film
    from ros_visualise.running.play import play

    return play(film(options.input, options.size), options)


COMMAND = Command("play a video file", VideoOptions, run)

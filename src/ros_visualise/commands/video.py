"""``video``: a film, or a folder of pictures."""

from __future__ import annotations

from argparse import ArgumentParser
from dataclasses import dataclass

from ros_visualise.commands import Command
from ros_visualise.running.options import PlayingOptions, add_playing_options, add_size_option


@dataclass(frozen=True, kw_only=True)
class VideoOptions(PlayingOptions):
    """Options of ``video`` and ``camera``."""

    input: str
    size: str


def add_arguments(parser: ArgumentParser) -> None:
    """Which film, and how it is played."""
    add_playing_options(parser)
    parser.add_argument(
        "input", metavar="FILE", help="any video that FFmpeg can read, or a folder of pictures"
    )
    add_size_option(parser)


def run(options: VideoOptions) -> int:
    """Play the film."""
    from ros_visualise.running.graphs import film
    from ros_visualise.running.play import play

    return play(film(options.input, options.size), options)


COMMAND = Command("play a video file", add_arguments, VideoOptions, run)

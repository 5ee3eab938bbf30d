"""``landmarks``: what is found in pictures, videos and recordings, and where it is."""

from __future__ import annotations

from argparse import ArgumentParser
from dataclasses import dataclass
from pathlib import Path

from ros_visualise.commands import Command
from ros_visualise.running.argument_types import tag_size
from ros_visualise.running.options import (
    MemoryOptions,
    PartOptions,
    SettingOptions,
    WorldOptions,
    add_memory_option,
    add_part,
    add_settings,
    add_world_options,
)
from ros_visualise.simulation.robots import OURS


@dataclass(frozen=True, kw_only=True)
class LandmarksOptions(WorldOptions, PartOptions, SettingOptions, MemoryOptions):
    """Options of ``landmarks``."""

    input: str
    families: str
    tags: str
    size: float | None
    model: str
    calibration: str
    topic: str
    map: Path | None
    survey: str
    overwrite: bool
    json: bool


def add_arguments(parser: ArgumentParser) -> None:
    """Which source, what is to be found in it, and what is written."""
    parser.add_argument(
        "input",
        metavar="SRC",
        help="a picture, a folder of pictures, a video, a recording (with images, or with tags that"
        f" were found before), or a simulated robot: {OURS}",
    )
    _add_what_is_asked(parser)
    _add_source(parser)
    parser.add_argument(
        "--map", type=Path, metavar="OUT", help="write the landmarks to this .yaml file"
    )
    parser.add_argument(
        "--survey",
        default="",
        metavar="FILE.yaml",
        help="measured places of tags, or distances between them, to be used for --map",
    )
    parser.add_argument("--overwrite", action="store_true", help="replace OUT if it exists")
    parser.add_argument("--json", action="store_true", help="print the result as one JSON object")
    add_memory_option(parser)


def _add_what_is_asked(parser: ArgumentParser) -> None:
    """What is looked for, and by what."""
    group = parser.add_argument_group("landmarks")
    group.add_argument(
        "--families",
        default="",
        metavar="NAME,...",
        help="families of tags, such as tag25h9 or 5x5_1000 (default: tag36h11)",
    )
    group.add_argument(
        "--tags",
        default="",
        metavar="SIZES.yaml",
        help="file with the sizes of tags and with bundles of tags, in apriltag_ros's format",
    )
    group.add_argument(
        "--size",
        type=tag_size,
        metavar="METRES",
        help="side of the black square of all tags that are not in --tags; without a size "
        "there are no poses",
    )
    group.add_argument(
        "--model",
        default="",
        metavar="FILE.onnx|none",
        help="the network that finds objects (default: our own, for helipads, posts and "
        "vehicles, if the extra detect is installed); none: find only tags",
    )
    group.add_argument(
        "--calibration",
        default="",
        metavar="FILE.yaml",
        help="the camera's calibration, in ROS's format; without one there are no poses",
    )


def _add_source(parser: ArgumentParser) -> None:
    """Which part of the source is looked at, and by which parameters."""
    source = parser.add_argument_group("source")
    source.add_argument(
        "--topic", default="", help="of a recording: the images, or the tags that were found before"
    )
    add_world_options(source, without_mission="the robot's own")
    source.set_defaults(world=None, seed=None)  # what nobody gave is not refused
    add_part(source)
    add_settings(parser.add_argument_group("nodes"))


def run(options: LandmarksOptions) -> int:
    """Find landmarks until the source ends; 1 if something was lost."""
    from ros_visualise.commands.landmarks.work import find_landmarks

    return find_landmarks(options)


COMMAND = Command(
    "find tags and objects in pictures, videos and recordings, and map them",
    add_arguments,
    LandmarksOptions,
    run,
)

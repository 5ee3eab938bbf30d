"""What can be asked of the command ``landmarks``."""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path
from typing import Any

from ros_visualise.options.shared import (
    MISSION,
    add_memory_option,
    add_part,
    add_settings,
    add_world_options,
    tag_size,
)
from ros_visualise.simulation.robots import OURS


def add_landmarks(commands: Any) -> None:
    """The command ``landmarks``."""
    landmarks = commands.add_parser(
        "landmarks", help="find tags and objects in pictures, videos and recordings, and map them"
    )
    landmarks.set_defaults(module="landmarks")
    landmarks.add_argument(
        "input",
        metavar="SRC",
        help="a picture, a folder of pictures, a video, a recording (with images, or with tags that"
        f" were found before), or a simulated robot: {OURS}",
    )
    _add_what_is_asked(landmarks)
    _add_source(landmarks)
    landmarks.add_argument(
        "--map", type=Path, metavar="OUT", help="write the landmarks to this .yaml file"
    )
    landmarks.add_argument(
        "--survey",
        default="",
        metavar="FILE.yaml",
        help="measured places of tags, or distances between them, to be used for --map",
    )
    landmarks.add_argument("--overwrite", action="store_true", help="replace OUT if it exists")
    landmarks.add_argument(
        "--json", action="store_true", help="print the result as one JSON object"
    )
    add_memory_option(landmarks)


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
    add_world_options(source)
    source.add_argument(
        "--mission", metavar="SHAPE|FILE", help=f"{MISSION} (default: the robot's own)"
    )
    source.set_defaults(world=None, seed=None)  # what nobody gave is not refused
    add_part(source)
    add_settings(parser.add_argument_group("nodes"))

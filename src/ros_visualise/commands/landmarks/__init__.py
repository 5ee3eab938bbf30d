"""``landmarks``: landmarks in pictures, videos and recordings, and their poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ros_visualise.commands import Command
from ros_visualise.running.arguments import argument, option, tag_size
from ros_visualise.running.options import (
    MemoryOptions,
    PartOptions,
    SettingOptions,
    WorldOptions,
    mission_option,
)
from ros_visualise.simulation.robots import OURS


@dataclass(frozen=True, kw_only=True)
class DetectionOptions:
    """Landmarks that are detected, and how."""

    GROUP = "landmarks"

    families: str = option(
        "", "families of tags, such as tag25h9 or 5x5_1000 (default: tag36h11)", metavar="NAME,..."
    )
    tags: str = option(
        "",
        "file with tag sizes and bundles (apriltag_ros format), and optionally ignore_tags and"
        " tag_id_remap (TagSLAM format)",
        metavar="SIZES.yaml",
    )
    ignore_tags: str = option(
        "", "ids of tags to ignore, such as those on moving objects", metavar="ID,..."
    )
    size: float | None = option(
        None,
        "side of the black square in metres, for all tags that are not in --tags; needed for poses",
        type=tag_size,
        metavar="METRES",
    )
    model: str = option(
        "",
        "the detection network (default: our own, for helipads, posts and vehicles, if the pip"
        " extra [detect] is installed); none: detect only tags",
        metavar="FILE.onnx|none",
    )
    calibration: str = option(
        "",
        "camera calibration in the ROS format, needed for poses; for several cameras, give one"
        " file each",
        metavar="FILE.yaml,...",
    )


@dataclass(frozen=True, kw_only=True)
class LandmarksOptions(DetectionOptions, WorldOptions, PartOptions, SettingOptions, MemoryOptions):
    """Options of ``landmarks``."""

    input: str = argument(
        "a picture, a folder of pictures, a video, a recording (with images or recorded tags),"
        f" or a simulated robot: {OURS}",
        metavar="SRC",
    )
    beside: Sequence[str] = option(
        [],
        "a recording or log from the same time, such as flight.ulg, with the poses of the camera;"
        " repeatable",
        metavar="FILE",
    )
    offset: Sequence[str] = option(
        [],
        "shift a --beside source in time (positive: later); auto aligns it by"
        " comparing its motion with that in the video; repeatable",
        metavar="NAME=SECONDS|auto",
    )
    mission: str | None = mission_option("the robot's own")
    topic: str = option(
        "",
        "topic of a recording: images, or recorded tags; for --map one for each camera of a rig"
        " (default: the first, and for --map all with a calibration and a frame of their own)",
        metavar="TOPIC,...",
    )
    map: Path | None = option(None, "write the landmarks to this .yaml file", metavar="OUT")
    places: bool = option(
        False,
        "with --map, also map places that can be recognized without tags (OUT.places.npz);"
        " needs images and odometry",
    )
    survey: str = option(
        "", "measured positions of tags, or distances between them, for --map", metavar="FILE.yaml"
    )
    geo: Path | None = option(
        None,
        "write geographic positions of the landmarks, with error ellipses, and the camera's track",
        metavar="OUT.geojson|.kml|.gpx|.csv",
    )
    tracks: bool = option(
        False,
        "track objects over time with the tracker node; the --geo file then contains their tracks",
    )
    overwrite: bool = option(False, "replace OUT if it exists")
    json: bool = option(False, "print the result as one JSON object")


COMMAND = Command(
    "detect tags and objects in pictures, videos and recordings, and map them",
    LandmarksOptions,
    "ros_visualise.commands.landmarks.work:find_landmarks",
)

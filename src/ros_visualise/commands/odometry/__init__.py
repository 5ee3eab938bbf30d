"""``odometry``: the trajectory of a camera by its images."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ros_visualise.commands import Command
from ros_visualise.running.arguments import argument, not_negative, option, positive
from ros_visualise.running.options import MemoryOptions, PartOptions


@dataclass(frozen=True, kw_only=True)
class OdometryOutputOptions:
    """Files that are written."""

    GROUP = "output"

    out: Sequence[str] = option(
        [],
        "write the trajectory of the camera: .kitti (one line per image) or .tum; repeatable",
        metavar="FILE",
    )
    covariances: Path | None = option(
        None,
        "write the covariances of the poses: lines of a time and 36 numbers, x y z in metres and"
        " rotations about these axes",
        metavar="FILE",
    )
    plot: Path | None = option(
        None, "draw the trajectory to this .png, .svg or .pdf", metavar="FILE"
    )
    overwrite: bool = option(False, "replace existing files")
    json: bool = option(False, "print a report as one JSON object")


@dataclass(frozen=True, kw_only=True)
class OdometryOptions(OdometryOutputOptions, PartOptions, MemoryOptions):
    """Options of ``odometry``."""

    input: str = argument(
        "a video, a folder of pictures, a KITTI folder, or a recording with images", metavar="SRC"
    )
    topic: str | None = option(
        None, "image topic of a recording (default: the first)", metavar="TOPIC"
    )
    right: str | None = option(
        None,
        "topic of the right images of a stereo pair, or none (default: the camera that the"
        " calibration places to the right of the first)",
        metavar="TOPIC|none",
    )
    calibration: str = option(
        "",
        "camera calibration in the ROS format, or KITTI's calib.txt (default: the source's, or"
        " a focal length estimated from the images)",
        metavar="FILE",
    )
    height: float | None = option(
        None,
        "height of the camera above the ground in metres, from which the scale is computed",
        type=positive,
        metavar="METRES",
    )
    scale: str | None = option(
        None,
        "topic with odometry, poses or fixes, from which the scale is computed; without a scale,"
        " lengths"
        " are in arbitrary units",
        metavar="TOPIC",
    )
    imu: str | None = option(
        None,
        "topic of an IMU, which gives the scale if the camera is at rest for half a second, or"
        " speeds up, slows down or turns; its transform to the camera is needed",
        metavar="TOPIC",
    )
    fps: float = option(
        10.0,
        "images per second, for a folder of pictures (default: %(default)g)",
        type=positive,
        metavar="N",
    )
    readout: float | None = option(
        None,
        "time from the first to the last row of a rolling shutter, milliseconds (default:"
        " estimated with --imu, otherwise 0)",
        type=not_negative,
        metavar="MS",
    )
    keep_drift: bool = option(
        False, "do not correct the trajectory when the camera returns to a known place"
    )
    corners: int = option(
        300, "number of corners to track (default: %(default)s)", type=int, metavar="N"
    )


COMMAND = Command(
    "estimate the trajectory of a camera from its images (visual odometry)",
    OdometryOptions,
    "ros_visualise.commands.odometry.work:find_trajectory",
)

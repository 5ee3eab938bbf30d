"""``calibrate``: a camera, by pictures of a board; and the board itself, for printing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ros_visualise.commands import Command
from ros_visualise.running.arguments import argument, option, positive
from ros_visualise.running.options import MemoryOptions


@dataclass(frozen=True, kw_only=True)
class BoardOptions:
    """The board with the pattern."""

    GROUP = "board"

    pattern: str = option(
        "chessboard",
        "pattern on the board (default: %(default)s)",
        choices=("chessboard", "charuco", "aprilgrid"),
    )
    size: str = option(
        "9x6",
        "number of inner corners of a chessboard, squares of a ChArUco board or tags of an"
        " AprilGrid (default: %(default)s); if no such board is found, similar counts are tried,"
        " such as squares instead of corners",
        metavar="COLUMNSxROWS",
    )
    square: float | None = option(
        None,
        "side of a square or tag in metres, for --board (default: what fits the page)",
        type=positive,
        metavar="M",
    )
    share: float | None = option(
        None,
        "side of a ChArUco marker as a fraction of the side of a square (default: 0.75); gap"
        " between the tags of an AprilGrid as a fraction of the side of a tag (default: 0.3)",
        type=positive,
        metavar="S",
    )
    dictionary: str | None = option(
        None,
        "marker dictionary, by its OpenCV name (default: 5X5_1000, or APRILTAG_36h11 for an"
        " AprilGrid)",
        metavar="NAME",
    )
    board: Path | None = option(
        None, "write the board for printing: a .pdf or .svg", metavar="FILE"
    )
    page: str = option(
        "A4", "A4, A3, Letter or WIDTHxHEIGHT in mm (default: %(default)s)", metavar="PAGE"
    )


@dataclass(frozen=True, kw_only=True)
class CalibrateOptions(BoardOptions, MemoryOptions):
    """Options of ``calibrate``."""

    input: Sequence[str] = argument(
        "pictures, a folder of pictures, a video, a recording, or a camera (/dev/video0, 0, a URL)",
        nargs="*",
        metavar="SRC",
    )
    model: str = option(
        "pinhole",
        "lens: pinhole (plumb_bob), rational (rational_polynomial) or fisheye (equidistant)"
        " (default: %(default)s)",
        choices=("pinhole", "rational", "fisheye"),
    )
    topic: str | None = option(None, "image topic of a recording (default: the first)")
    duration: float | None = option(
        None, "watch a camera for S seconds", type=positive, metavar="S"
    )
    output: Path | None = option(None, "write the calibration as YAML, for ROS", metavar="FILE")
    name: str = option("camera", "the camera's name in that file (default: %(default)s)")
    plot: Path | None = option(
        None, "draw points and residuals: a .png, .svg or .pdf", metavar="FILE"
    )
    overwrite: bool = option(False, "replace existing files")
    json: bool = option(False, "print a report as one JSON object")


COMMAND = Command(
    "calibrate a camera from pictures of a board, or print such a board",
    CalibrateOptions,
    "ros_visualise.commands.calibrate.work:calibrate_camera",
)

"""``calibrate``: a camera, by pictures of a board; and the board itself, for printing."""

from __future__ import annotations

from argparse import ArgumentParser
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ros_visualise.commands import Command
from ros_visualise.running.argument_types import positive
from ros_visualise.running.options import MemoryOptions, add_memory_option


@dataclass(frozen=True, kw_only=True)
class CalibrateOptions(MemoryOptions):
    """Options of ``calibrate``."""

    input: Sequence[str]
    pattern: str
    size: str
    square: float | None
    share: float | None
    dictionary: str | None
    board: Path | None
    page: str
    model: str
    topic: str | None
    duration: float | None
    output: Path | None
    name: str
    plot: Path | None
    overwrite: bool
    json: bool


def add_arguments(parser: ArgumentParser) -> None:
    """Which pictures, which board, and what is written."""
    parser.add_argument(
        "input",
        metavar="SRC",
        nargs="*",
        help="pictures, a folder of them, a video, a recording, or a camera: /dev/video0, 0, a URL",
    )
    _add_board(parser.add_argument_group("board"))
    parser.add_argument(
        "--model",
        choices=("pinhole", "rational", "fisheye"),
        default="pinhole",
        help="lens: pinhole (plumb_bob), rational (rational_polynomial) or fisheye (equidistant)"
        " (default: %(default)s)",
    )
    parser.add_argument("--topic", help="images of a recording (default: the first)")
    parser.add_argument(
        "--duration", type=positive, metavar="S", help="watch a camera for S seconds"
    )
    parser.add_argument(
        "--output", type=Path, metavar="FILE", help="write the calibration as YAML, for ROS"
    )
    parser.add_argument(
        "--name", default="camera", help="the camera's name in that file (default: %(default)s)"
    )
    parser.add_argument(
        "--plot", type=Path, metavar="FILE", help="draw points and residuals: a .png or .svg"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace existing files")
    parser.add_argument("--json", action="store_true", help="print a report as one JSON object")
    add_memory_option(parser)


def _add_board(group: Any) -> None:
    group.add_argument(
        "--pattern",
        choices=("chessboard", "charuco", "aprilgrid"),
        default="chessboard",
        help="what is on the board (default: %(default)s)",
    )
    group.add_argument(
        "--size",
        metavar="COLUMNSxROWS",
        default="9x6",
        help="inner corners of a chessboard, squares of ChArUco, tags of an AprilGrid"
        " (default: %(default)s); other readings are tried too",
    )
    group.add_argument(
        "--square",
        type=positive,
        metavar="M",
        help="side of a square or tag in metres, for --board (default: what fits the page)",
    )
    group.add_argument(
        "--share",
        type=positive,
        metavar="S",
        help="side of a ChArUco marker, as a fraction of a square's (default: 0.75); gap "
        "between the tags of an AprilGrid, as a fraction of a tag's side (default: 0.3)",
    )
    group.add_argument(
        "--dictionary",
        metavar="NAME",
        help="OpenCV's name of the markers (default: 5X5_1000; of an AprilGrid APRILTAG_36h11)",
    )
    group.add_argument(
        "--board", type=Path, metavar="FILE", help="write the board for printing: a .pdf or .svg"
    )
    group.add_argument(
        "--page",
        default="A4",
        metavar="PAGE",
        help="A4, A3, Letter or WIDTHxHEIGHT in mm (default: %(default)s)",
    )


def run(options: CalibrateOptions) -> int:
    """Print the board if that is asked for, and calibrate if there are images."""
    from ros_visualise.commands.calibrate.work import calibrate_camera

    return calibrate_camera(options)


COMMAND = Command(
    "calibrate a camera by pictures of a board, or print the board",
    add_arguments,
    CalibrateOptions,
    run,
)

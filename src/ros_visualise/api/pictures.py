"""Detecting tags in an image, and calibrating a camera by pictures of a board."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from os import PathLike, fspath
from pathlib import Path
from typing import Literal

import numpy as np

from ros_visualise.api.nodes import ImageLike, as_image, node_function
from ros_visualise.core.errors import UsageError, did_you_mean
from ros_visualise.data import CameraInfo, Detection, Detections, Image
from ros_visualise.landmarks.calibration.boards import BoardKind, board_of
from ros_visualise.landmarks.calibration.calibrating import CameraCalibration
from ros_visualise.landmarks.calibration.calibrating import calibrate as calibrate_views
from ros_visualise.landmarks.calibration.collecting import ViewCollector
from ros_visualise.landmarks.calibration.lenses import Lens
from ros_visualise.sources.pictures import read_picture


def detect(
    image: ImageLike | str | PathLike[str],
    families: str = "tag36h11",
    *,
    size_m: float | None = None,
    calibration: CameraInfo | None = None,
) -> tuple[Detection, ...]:
    """The AprilTag and ArUco tags in an image.

    Args:
        image: an array, gray or BGR, an `Image`, or the path of a picture.
        families: of the tags, as of the node ``tag_detector``.
        size_m: side of a tag's black square, metres, for poses.
        calibration: of the camera, for poses.

    Raises:
        OpenError: the picture cannot be read.
        ParameterError: an unknown family.
    """
    found = _read(image)
    if calibration is not None:
        found = replace(found, camera_info=calibration)
    sized = {} if size_m is None else {"size": size_m}
    answer = node_function("tag_detector", families=families, **sized)(found)
    return tuple(answer.of("detections", Detections).detections)


def calibrate(
    images: Iterable[ImageLike | str | PathLike[str]],
    size: str = "9x6",
    *,
    pattern: Literal["chessboard", "charuco", "aprilgrid"] = "chessboard",
    model: Literal["pinhole", "rational", "fisheye"] = "pinhole",
) -> CameraCalibration:
    """The calibration of the camera that took pictures of a board; ``info`` is that of ROS.

    Args:
        images: arrays, gray or BGR, `Image` messages, or paths of pictures.
        size: inner corners of a chessboard, squares of ChArUco, tags of an AprilGrid.
        pattern: on the board.
        model: of the lens.

    Raises:
        OpenError: a picture cannot be read.
        UsageError: the board is in too few of them.
    """
    kinds, models = ([one.value for one in kind] for kind in (BoardKind, Lens))
    for given, known in ((pattern, kinds), (model, models)):
        if given not in known:
            raise UsageError(f"no {given!r}{did_you_mean(given, known)}")
    collector = ViewCollector(board_of(BoardKind(pattern), size, None, None, None))
    for number, image in enumerate(images):
        collector.add(_read(image), f"image {number}")
    return calibrate_views(collector.checked_views, Lens(model))


def _read(image: ImageLike | str | PathLike[str]) -> Image:
    if isinstance(image, np.ndarray | Image):
        return as_image(image)
    try:
        return read_picture(Path(fspath(image)))
    except TypeError:
        raise UsageError(
            f"{type(image).__name__} is not an image; give an array, an Image or a path"
        ) from None

"""Where a camera's calibration is kept, and how it is written, as camera_info_manager does it."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from ros_visualise.core.errors import RecordingError, UnsupportedImage, UsageError
from ros_visualise.data import CameraInfo, Floats
from ros_visualise.vision.rectification import model_of
from ros_visualise.vision.reshape import Size

_DEFAULT = "file://${ROS_HOME}/camera_info/${NAME}.yaml"


def camera_name(node: str) -> str:
    """What the camera of a node is called: as the node, in one word."""
    return node.strip("/").replace("/", "_")


def locate(url: str, node: str) -> str:
    """Where the calibration of a node's camera is on a graph.

    Args:
        url: with ``${NAME}``, that of the camera, and ``${ROS_HOME}``; empty: the default of
            camera_info_manager, ROS_HOME/camera_info/NAME.yaml.
        node: its full name.
    """
    home = os.environ.get("ROS_HOME") or str(Path.home() / ".ros")
    text = url or _DEFAULT
    return text.replace("${NAME}", camera_name(node)).replace("${ROS_HOME}", home)


def check(info: CameraInfo, size: Size) -> None:
    """Refuse what cannot be the calibration of images of that size.

    Raises:
        UsageError: the message says why.
    """
    if (info.width, info.height) != size:
        raise UsageError(
            f"it is for images of {info.width}x{info.height}, and the camera's are"
            f" {size[0]}x{size[1]}"
        )
    arrays = (info.K, info.D, info.R, info.projection)
    if not all(np.isfinite(array).all() for array in arrays):
        raise UsageError("it holds a value that is not a number")
    if not (info.K[0, 0] > 0 and info.K[1, 1] > 0):
        raise UsageError("its K has no focal lengths")
    try:
        model_of(info, -1)
    except UnsupportedImage as error:
        raise UsageError(str(error)) from None


def save(info: CameraInfo, path: Path, name: str) -> None:
    """Write a calibration, so that the file is always whole: the old one or the new one.

    Args:
        info: the calibration.
        path: a YAML file; its folder is made where there is none.
        name: of the camera.

    Raises:
        RecordingError: it cannot be written.
    """
    target = Path(os.path.realpath(path))  # a link stays one
    part = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            with part.open("w") as file:
                file.write(to_yaml(info, name))
                file.flush()
                os.fsync(file.fileno())
            os.replace(part, target)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise RecordingError(
            f"{path}: cannot be written: {error.strerror}; give a file in another folder"
        ) from None


def to_yaml(info: CameraInfo, name: str) -> str:
    """A calibration as camera_calibration_parsers writes it, with every digit."""
    lines = [
        f"image_width: {info.width}",
        f"image_height: {info.height}",
        f"camera_name: {name}",
        *_matrix("camera_matrix", info.K),
        f"distortion_model: {info.distortion_model or 'plumb_bob'}",
        *_matrix("distortion_coefficients", info.D[None]),
        *_matrix("rectification_matrix", info.R),
        *_matrix("projection_matrix", info.projection),
    ]
    return "\n".join(lines) + "\n"


def _matrix(name: str, values: Floats) -> list[str]:
    rows, columns = values.shape
    data = ", ".join(_number(value) for value in values.ravel())
    return [f"{name}:", f"  rows: {rows}", f"  cols: {columns}", f"  data: [{data}]"]


def _number(value: float) -> str:
    """With a point even before an exponent, without which YAML 1.1 takes it for a text."""
    text = repr(float(value))
    return text if "." in text else text.replace("e", ".0e")

"""Calibrations of cameras in YAML files, as ROS's cameracalibrator writes them."""

from __future__ import annotations

import logging
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import unquote, urlsplit

import numpy as np

from ros_visualise.core.errors import OpenError, RecordingError, UnsupportedImage, UsageError
from ros_visualise.core.yaml_files import open_yaml
from ros_visualise.data import CameraInfo, Detections, Floats, Image
from ros_visualise.vision.rectification import model_of
from ros_visualise.vision.reshape import Size, resized

log = logging.getLogger(__name__)

C = TypeVar("C", Image, Detections)

_WIDEST = 1 << 16  # pixels; no sensor has so many in a row
_WANTED = "give a calibration file, such as the ost.yaml of cameracalibrator"
_COVARIANCE = "intrinsics_covariance"  # ROS's own readers skip what they do not know
_DEFAULT = "file://${ROS_HOME}/camera_info/${NAME}.yaml"


class Calibration:
    """The calibration of a camera, made to fit its images.

    Its file is read again when it changes, and may appear later: the camera is calibrated from then
    on, as when it is calibrated while it runs.

    Args:
        url: a path or ``file:///path``; empty: the camera is not calibrated.

    Raises:
        OpenError: the file is no calibration.
    """

    def __init__(self, url: str) -> None:
        self._url = url
        self._path = path_of(url) if url else None
        self._version = self._look()
        self._info = read_calibration(url) if self._version else None
        self._fitted: dict[Size, CameraInfo | None] = {}
        if url and self._info is None:
            log.info("%s: no such file; publishing images without a calibration", url)

    def fit(self, size: Size) -> CameraInfo | None:
        """The calibration of images of that size; raises OpenError if they are of another shape."""
        if self._info is None:
            return None
        own = (self._info.width, self._info.height)
        if not _is_scaled(own, size):
            raise OpenError(
                f"{self._url}: made for images of {own[0]}x{own[1]};"
                f" images of {size[0]}x{size[1]} have a different aspect ratio"
            )
        return self._info if own == size else resized(self._info, own, size)

    def add_to(self, image: C) -> C:
        """The image with its calibration, unless that is of another shape, which is logged once.

        Detections do not tell the size of their image: it is that of the calibration.
        """
        self._follow()
        if isinstance(image, Detections):
            return image if self._info is None else replace(image, camera_info=self._info)
        size = (image.width, image.height)
        if size not in self._fitted:
            self._fitted[size] = self._fit_or_log(size)
        info = self._fitted[size]
        return image if info is None else replace(image, camera_info=info)

    def _look(self) -> tuple[int, int] | None:
        """A value that differs between versions of the file; None without a file."""
        try:
            found = None if self._path is None else self._path.stat()
        except OSError:
            return None
        return None if found is None else (found.st_mtime_ns, found.st_ino)

    def _follow(self) -> None:
        """Take over a new version of the file, if it can be read."""
        version = self._look()
        if version in (None, self._version):
            return
        self._version = version
        try:
            self._info = read_calibration(self._url)
        except OpenError as error:
            log.error("%s; keeping the previous calibration", error)
        else:
            log.info("%s: using the new calibration", self._url)
            self._fitted.clear()

    def _fit_or_log(self, size: Size) -> CameraInfo | None:
        try:
            return self.fit(size)
        except OpenError as error:
            log.error("%s; publishing images without a calibration", error)
            return None


def read_calibration(url: str) -> CameraInfo:
    """The calibration in a file, given by a path or ``file:///path``; raises OpenError."""
    path = path_of(url)
    values = open_yaml(path, _WANTED)
    try:
        return _parse(values)
    except ValueError as error:
        raise OpenError(f"{path}: {error}; {_WANTED}") from None


@dataclass(frozen=True, eq=False)
class CalibrationUncertainty:
    """Uncertainty of a calibration, in pixels of images of the calibrated size.

    Attributes:
        covariance: (n, n) of fx, fy, cx, cy and the distortion coefficients.
        info: the calibration.
    """

    covariance: Floats
    info: CameraInfo

    @property
    def deviations(self) -> Floats:
        """(n,) standard deviations."""
        return np.asarray(np.sqrt(np.diag(self.covariance)), np.float64)

    @property
    def focal(self) -> float:
        """Standard deviation of the focal length, as a fraction; the larger one of fx and fy."""
        return float((self.deviations[:2] / self.info.K[[0, 1], [0, 1]]).max())

    @property
    def center_px(self) -> float:
        """Standard deviation of the principal point along u or v; the larger one, pixels."""
        return float(self.deviations[2:4].max())


def find_uncertainty(url: str) -> CalibrationUncertainty | None:
    """The uncertainty in a file; None if it holds none. Raises OpenError."""
    values = open_yaml(path_of(url), _WANTED)
    return read_uncertainty(url) if _COVARIANCE in values else None


def read_uncertainty(url: str) -> CalibrationUncertainty:
    """The uncertainty in a file that ``ros-visualise calibrate`` wrote; raises OpenError."""
    path, info = path_of(url), read_calibration(url)
    values = open_yaml(path, _WANTED)
    if _COVARIANCE not in values:
        raise OpenError(f"{path}: no {_COVARIANCE}; create the file with ros-visualise calibrate")
    try:
        covariance = _matrix(values, _COVARIANCE, 4 + info.D.size, 4 + info.D.size)
        least, most = np.linalg.eigvalsh(covariance)[[0, -1]]
        if not np.allclose(covariance, covariance.T) or least < -1e-9 * most:
            raise ValueError(f"its {_COVARIANCE} is not symmetric and positive semidefinite")
    except ValueError as error:
        raise OpenError(f"{path}: {error}") from None
    return CalibrationUncertainty(covariance, info)


def path_of(url: str) -> Path:
    """The file of a path or ``file:///path``; raises OpenError on other addresses."""
    if "://" not in url:
        return Path(url)
    parts = urlsplit(url)
    if parts.scheme == "package":
        raise OpenError(f"{url}: package:// needs ROS; give the file's path")
    if parts.scheme != "file" or parts.netloc not in ("", "localhost"):
        raise OpenError(f"{url}: give a path or file:///PATH")
    return Path(unquote(parts.path))


def _parse(values: Any) -> CameraInfo:
    if not isinstance(values, Mapping):
        raise ValueError("no camera calibration")
    K = _matrix(values, "camera_matrix", 3, 3)
    if not (K[0, 0] > 0 and K[1, 1] > 0):
        raise ValueError("its camera_matrix has no focal lengths")
    return CameraInfo(
        height=_side(values, "image_height"),
        width=_side(values, "image_width"),
        K=K,
        D=_numbers(values, "distortion_coefficients"),
        R=_matrix(values, "rectification_matrix", 3, 3),
        P=_matrix(values, "projection_matrix", 3, 4),
        distortion_model=str(values.get("distortion_model", "plumb_bob")),
    )


def _side(values: Mapping[str, Any], name: str) -> int:
    side = values.get(name)
    if isinstance(side, bool) or not isinstance(side, int) or not 0 < side <= _WIDEST:
        raise ValueError(f"no camera calibration: its {name} is {side}")
    return side


def _matrix(values: Mapping[str, Any], name: str, rows: int, columns: int) -> Floats:
    numbers = _numbers(values, name)
    if numbers.size != rows * columns:
        raise ValueError(f"its {name} has {numbers.size} numbers, not {rows * columns}")
    return numbers.reshape(rows, columns)


def _numbers(values: Mapping[str, Any], name: str) -> Floats:
    matrix = values.get(name)
    if not isinstance(matrix, Mapping) or not isinstance(matrix.get("data"), list):
        raise ValueError(f"no camera calibration: it has no {name} with data")
    try:
        numbers = np.array(matrix["data"], np.float64)
    except (TypeError, ValueError):
        numbers = np.array([np.nan])
    if numbers.ndim != 1 or not np.isfinite(numbers).all():
        raise ValueError(f"its {name} holds a value that is not a number")
    return numbers


def _is_scaled(before: Size, after: Size) -> bool:
    """True if the sizes have the same aspect ratio, but for rounding."""
    (width, height), (new_width, new_height) = before, after
    return (
        abs(new_width - width * new_height / height) <= 1
        or abs(new_height - height * new_width / width) <= 1
    )


def camera_name(node: str) -> str:
    """Name of a node's camera: that of the node, in one word."""
    return node.strip("/").replace("/", "_")


def locate(url: str, node: str) -> str:
    """Path or URL of the calibration of a node's camera on a graph.

    Args:
        url: with ``${NAME}``, that of the camera, and ``${ROS_HOME}``; empty: the default of
            camera_info_manager, ROS_HOME/camera_info/NAME.yaml.
        node: its full name.
    """
    home = os.environ.get("ROS_HOME") or str(Path.home() / ".ros")
    text = url or _DEFAULT
    return text.replace("${NAME}", camera_name(node)).replace("${ROS_HOME}", home)


def check(info: CameraInfo, size: Size) -> None:
    """Raise UsageError unless it can be the calibration of images of that size."""
    if (info.width, info.height) != size:
        raise UsageError(
            f"it is for images of {info.width}x{info.height}; the camera's are {size[0]}x{size[1]}"
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
    """Write a calibration so that the file is always whole; raises RecordingError."""
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


def to_yaml(info: CameraInfo, name: str, covariance: Floats | None = None) -> str:
    """A calibration as camera_calibration_parsers writes it, with every digit.

    Args:
        info: the calibration.
        name: of the camera.
        covariance: see `CalibrationUncertainty`.
    """
    lines = [
        f"image_width: {info.width}",
        f"image_height: {info.height}",
        f"camera_name: {name}",
        *_matrix_lines("camera_matrix", info.K),
        f"distortion_model: {info.distortion_model or 'plumb_bob'}",
        *_matrix_lines("distortion_coefficients", info.D[None]),
        *_matrix_lines("rectification_matrix", info.R),
        *_matrix_lines("projection_matrix", info.projection),
        *([] if covariance is None else _matrix_lines(_COVARIANCE, covariance)),
    ]
    return "\n".join(lines) + "\n"


def _matrix_lines(name: str, values: Floats) -> list[str]:
    rows, columns = values.shape
    data = ", ".join(_yaml_number(value) for value in values.ravel())
    return [f"{name}:", f"  rows: {rows}", f"  cols: {columns}", f"  data: [{data}]"]


def _yaml_number(value: float) -> str:
    """With a point even before an exponent, or YAML 1.1 reads it as a text."""
    text = repr(float(value))
    return text if "." in text else text.replace("e", ".0e")

"""Parameters of tag poses."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from ros_visualise.core.errors import OpenError, ParameterError
from ros_visualise.core.limits import MAX_TAG_M
from ros_visualise.core.params import param
from ros_visualise.landmarks.pose import CameraError
from ros_visualise.sources.calibration import CalibrationUncertainty, read_uncertainty


@dataclass(frozen=True)
class PoseParams:
    """Parameters of nodes that estimate poses of tags."""

    size: float = param(
        0.0,
        "side of the black square in metres, for tags that are not in the tags file;"
        " 0: unknown, so no poses are estimated",
        min=0,
        max=MAX_TAG_M,
        slider=(0, 1),
    )
    tags: str = param(
        "",
        "YAML file with tag sizes and bundles (apriltag_ros format), and tags to ignore or"
        " renumber (TagSLAM format)",
        file=bool,
    )
    ignore: str = param("", "ids of tags to ignore, such as 166,213")
    corner_floor: float = param(
        0.3,
        "standard deviation of the camera's corner errors, pixels; assumed for the first images"
        " and then estimated; 0.3 suits real cameras, 0 suits rendered images",
        min=0,
        max=10,
        slider=(0, 2),
        group="poses",
    )
    readout: float = param(
        -1.0,
        "readout time of the camera's rolling shutter from the first row to the last, seconds;"
        " the time stamp refers to the middle row; 0: global shutter; below 0: unknown, so"
        " corners of"
        " moving tags are less certain",
        min=-1,
        max=0.2,
        group="poses",
    )
    calibration: str = param(
        "",
        "camera calibration written by ros-visualise calibrate, whose uncertainty replaces"
        " focal_sigma and center_sigma; later changes to the file are ignored",
        file=bool,
        group="poses",
    )
    focal_sigma: float = param(
        0.0,
        "standard deviation of the calibration's focal lengths, percent; reported by "
        "ros-visualise calibrate",
        min=0,
        max=50,
        slider=(0, 2),
        group="poses",
    )
    center_sigma: float = param(
        0.0,
        "standard deviation of the calibration's principal point, pixels; reported by "
        "ros-visualise calibrate",
        min=0,
        max=1000,
        slider=(0, 10),
        group="poses",
    )

    def __post_init__(self) -> None:
        try:
            _ = self.camera
        except OpenError as error:
            raise ParameterError(f"calibration={self.calibration!r}: {error}") from None

    @property
    def camera(self) -> CameraError:
        """Errors of the camera and its calibration."""
        if not self.calibration:
            return CameraError(self.corner_floor, self.focal_sigma / 100, self.center_sigma)
        found = _read_once(self.calibration)
        return CameraError(self.corner_floor, found.focal, found.center_px)


@lru_cache(maxsize=8)
def _read_once(url: str) -> CalibrationUncertainty:
    return read_uncertainty(url)

"""What has to be known of tags, to tell where they are."""

from __future__ import annotations

from dataclasses import dataclass

from ros_visualise.landmarks.pose import CameraError
from ros_visualise.limits import MAX_TAG_M
from ros_visualise.params import param


@dataclass(frozen=True)
class PoseParams:
    """Parameters of nodes that give poses to tags."""

    size: float = param(
        0.0,
        "side of the black square in metres, of tags that the file does not know; 0: unknown, "
        "without a pose",
        min=0,
        max=MAX_TAG_M,
        slider=(0, 1),
    )
    tags: str = param(
        "", "YAML file with the sizes of tags and with bundles, as apriltag_ros has it"
    )
    corner_floor: float = param(
        0.0,
        "pixels that corners deviate at least, for the covariance; pictures and how poses fit tell "
        "the rest",
        min=0,
        max=10,
        slider=(0, 2),
        group="poses",
    )
    focal_sigma: float = param(
        0.0,
        "standard deviation of the calibration's focal lengths, percent; calibrate tells it",
        min=0,
        max=50,
        slider=(0, 2),
        group="poses",
    )
    center_sigma: float = param(
        0.0,
        "standard deviation of the calibration's principal point, pixels; calibrate tells it",
        min=0,
        max=1000,
        slider=(0, 10),
        group="poses",
    )

    @property
    def camera(self) -> CameraError:
        """What the camera and its calibration add to corners."""
        return CameraError(self.corner_floor, self.focal_sigma / 100, self.center_sigma)

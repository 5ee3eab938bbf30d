"""From corners in an image, and the camera's calibration, to poses with a covariance."""

from ros_visualise.landmarks.pose.corner_noise import REAL_CAMERA_PX, corner_sigma
from ros_visualise.landmarks.pose.estimating import (
    PoseEstimate,
    rig_poses,
    square_poses,
    squares_poses,
)

__all__ = [
    "REAL_CAMERA_PX",
    "PoseEstimate",
    "corner_sigma",
    "rig_poses",
    "square_poses",
    "squares_poses",
]

"""Poses with covariance from corners in a calibrated image."""

from ros_visualise.landmarks.pose.corner_errors import CornerErrors
from ros_visualise.landmarks.pose.corner_noise import EXACT, CameraError, corner_sigma
from ros_visualise.landmarks.pose.estimating import (
    PoseEstimate,
    merged,
    rig_poses,
    square_poses,
    squares_poses,
)

__all__ = [
    "EXACT",
    "CameraError",
    "CornerErrors",
    "PoseEstimate",
    "corner_sigma",
    "merged",
    "rig_poses",
    "square_poses",
    "squares_poses",
]

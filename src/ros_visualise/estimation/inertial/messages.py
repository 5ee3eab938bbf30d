"""Messages to visual-inertial odometry, and from it."""

from __future__ import annotations

import numpy as np

from ros_visualise.core.errors import NoTransform
from ros_visualise.data import CameraInfo, Floats, Header, Imu, Odometry, Pixels
from ros_visualise.estimation.camera_view import turning_of
from ros_visualise.estimation.imu import Mounting
from ros_visualise.estimation.inertial.filter import InertialSettings
from ros_visualise.estimation.inertial.lens import FOCAL_SIGMA
from ros_visualise.estimation.inertial.odometry import InertialOdometry, InertialPose
from ros_visualise.estimation.inertial.readout import UNKNOWN, Readout
from ros_visualise.estimation.inertial.tracks import CornerNoise
from ros_visualise.estimation.settings import CAMERA_TURN, CameraErrors
from ros_visualise.geometry import se3
from ros_visualise.geometry.frames import FrameTree

WHITE_PX, WALK_PX = 0.45, 0.375
"""Standard deviations of corners, pixels, see `CornerNoise`: larger than those of one corner, as
corners of an image err alike.
"""
MOVES_S = 5.0
"""Time constant of the error of the camera's attitude, s, as on a gimbal."""


class InertialInput:
    """Takes messages of a camera and an IMU.

    Args:
        info: calibration of the camera.
        base_frame: frame whose motion is estimated.
        corners: number that is followed.
        readout_s: of the camera's rolling shutter; None: unknown, and estimated.
        errors: of the camera's clock, attitude on the robot and focal length.

    Attributes:
        odometry: what takes them.
        problem: why the last message was not used; empty if it was.
    """

    def __init__(
        self,
        info: CameraInfo,
        base_frame: str,
        corners: int = 200,
        readout_s: float | None = None,
        errors: CameraErrors | None = None,
    ) -> None:
        pixel = 1 / float(np.sqrt(info.K[0, 0] * info.K[1, 1]))
        camera = errors or CameraErrors(0.02, np.radians(CAMERA_TURN), MOVES_S, FOCAL_SIGMA)
        readout = UNKNOWN if readout_s is None else Readout(readout_s)
        noise = CornerNoise(WHITE_PX * pixel, WALK_PX * pixel)
        settings = InertialSettings(noise, camera=camera, readout=readout)
        self.odometry = InertialOdometry(info, settings, corners)
        self.problem = ""
        self._base_frame = base_frame
        self._mounted: dict[str, Mounting] = {}

    def feel(self, imu: Imu, frames: FrameTree) -> None:
        """Take a measurement of the IMU."""
        name = imu.header.frame_id
        if imu.angular_covariance[0, 0] < 0 or imu.linear_covariance[0, 0] < 0:  # REP 145
            self.problem = "the IMU is not used: it lacks angular velocity or acceleration"
            return
        if name not in self._mounted:
            try:
                T = frames.lookup(self._base_frame, name, imu.header.stamp_ns)
            except NoTransform as error:
                self.problem = f"the IMU is not used: {error}"
                return
            self._mounted[name] = Mounting(T[:3, :3], T[:3, 3])
        self.odometry.feel(
            imu.header.stamp_ns, imu.angular_xyz, imu.linear_xyz, self._mounted[name]
        )

    def see(self, header: Header, gray: Pixels, frames: FrameTree) -> None:
        """Take an image."""
        stamp_ns, name = header.stamp_ns, header.frame_id
        try:
            T = frames.lookup(self._base_frame, name, stamp_ns)
        except NoTransform as error:
            self.problem = f"the image is not used: {error}"
            return
        self.problem = ""
        self.odometry.see(stamp_ns, gray, T, turning_of(frames, self._base_frame, header, T))


def odometry_of(pose: InertialPose, frame: str, base_frame: str) -> Odometry:
    """A pose as a message: covariances of the position, and of rotations about the robot."""
    position, quat = se3.to_pose(se3.from_parts(pose.R, pose.p))
    change = se3.about_itself(pose.p)
    covariance: Floats = change @ pose.covariance @ change.T
    header = Header(pose.stamp_ns, frame)
    return Odometry(
        position, quat, pose.linear, pose.angular, covariance, pose.of_twist, base_frame, header
    )

"""Visual-inertial odometry of a recording."""

from __future__ import annotations

from collections import deque

import numpy as np

from ros_visualise.commands.odometry.inputs import CameraImage, CameraInput
from ros_visualise.core.errors import NoTransform
from ros_visualise.data import Floats, Header, Imu
from ros_visualise.estimation.inertial.messages import InertialInput
from ros_visualise.estimation.visual.stretch import VisualPose
from ros_visualise.geometry import se3

_PATIENCE_NS = 1_000_000_000  # for the transform of an image


class InertialSteps:
    """Takes the images and measurements of a recording; the IMU is the robot.

    Attributes:
        reason, counts, done: as of `ros_visualise.estimation.visual.odometry.VisualOdometry`.
        lens_fault: warning if the images contradict the calibration; empty otherwise.
    """

    def __init__(self, found: CameraInput, corners: int, readout_s: float | None) -> None:
        self.reason = "waiting for the IMU"
        self.counts = {"images": 0, "keyframes": 0, "losses": 0}
        self.done: list[VisualPose] = []
        self.lens_fault = ""
        self._frames, self._info = found.frames, found.infos[0]
        self._corners, self._readout_s = corners, readout_s
        self._taker: InertialInput | None = None
        self._frame = ""
        self._waiting: deque[CameraImage] = deque()
        self._mounted: dict[int, Floats] = {}

    def feel(self, imu: Imu) -> None:
        """Take a measurement of the IMU."""
        if self._taker is None:
            self._frame = imu.header.frame_id
            self._taker = InertialInput(self._info, self._frame, self._corners, self._readout_s)
        self._taker.feel(imu, self._frames)
        self._advance(self._taker)

    def step(self, image: CameraImage) -> None:
        """Take an image."""
        self.counts["images"] += 1
        self._waiting.append(image)
        if self._taker is not None:
            self._advance(self._taker)

    def finish(self) -> list[VisualPose]:
        """Poses of the camera in that of the first image with one."""
        if not self.done:
            return []
        first = self.done[0]
        R, p = first.R.T, -first.R.T @ first.p
        back = se3.adjoint(R, p)
        return [
            one._replace(R=R @ one.R, p=R @ one.p + p, covariance=back @ one.covariance @ back.T)
            for one in self.done
        ]

    def _advance(self, taker: InertialInput) -> None:
        while self._waiting and self._is_placed(taker, self._waiting[0]):
            self._waiting.popleft()
        for stamp_ns, pose in taker.odometry.ready():
            T = self._mounted.pop(stamp_ns)
            self.reason = taker.odometry.reason
            self.lens_fault = taker.odometry.lens_fault or self.lens_fault
            self.counts["losses"] = taker.odometry.counts["gaps"]
            if pose is not None:
                R, p = pose.R @ T[:3, :3], pose.R @ T[:3, 3] + pose.p
                self.done.append(VisualPose(stamp_ns, R, p, pose.covariance, True, pose.is_lost))

    def _is_placed(self, taker: InertialInput, image: CameraImage) -> bool:
        """True once an image is taken, or its transform is not expected any longer."""
        try:
            T = self._frames.lookup(self._frame, image.frame, image.stamp_ns)
        except NoTransform as error:
            self.reason = str(error)
            return self._waiting[-1].stamp_ns - image.stamp_ns > _PATIENCE_NS
        self._mounted[image.stamp_ns] = np.asarray(T)
        taker.see(Header(image.stamp_ns, image.frame), image.gray, self._frames)
        return True

"""The node that finds the motion of a camera by what it sees."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import cv2
import numpy as np

from ros_visualise.core.errors import NoTransform
from ros_visualise.core.params import param
from ros_visualise.data import (
    CameraInfo,
    Deferred,
    DiagnosticArray,
    DiagnosticStatus,
    Floats,
    Header,
    Image,
    Imu,
    Level,
    NavSatFix,
    Odometry,
    Pixels,
    PointCloud,
    Transforms,
    TransformStamped,
)
from ros_visualise.estimation.inertial.lens import FOCAL_SIGMA
from ros_visualise.estimation.inertial.messages import (
    MOVES_S,
    InertialInput,
    odometry_of,
)
from ros_visualise.estimation.settings import CAMERA_TURN, CameraErrors
from ros_visualise.estimation.visual.odometry import VisualOdometry, VisualSettings
from ros_visualise.estimation.visual.stereo import StereoPairs, right_of
from ros_visualise.estimation.visual.stretch import VisualPose
from ros_visualise.geometry import se3
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.geometry.located import Locator
from ros_visualise.landmarks.once_log import OnceLog
from ros_visualise.nodes import node
from ros_visualise.vision import color
from ros_visualise.vision.depth import to_8_bit
from ros_visualise.vision.threads import fit_threads
from ros_visualise.vision.tracking import FollowedCorners

_FRAME = "visual_odom"
_POINT = np.dtype([(axis, np.float32) for axis in "xyz"])
_R_BASE_CAMERA = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # looking ahead (REP 103)
_ODOMETRY_M, _FIX_M = 0.02, 2.0  # standard deviations of positions
_USUAL_TURN = 0.5  # degrees, of a camera's attitude on the robot, if none is stated
_UNKNOWN = 1e6  # variance of a velocity while lost
_AT_REST = 1e-3  # rad: a camera that turns more on the robot is on a gimbal
_SCALE = 0.03  # of a velocity, as a fraction
_FOLLOWED, _NEW, _LOST = (80, 220, 80), (220, 160, 60), (60, 60, 240)  # BGR


@dataclass(frozen=True)
class CameraMotionParams:
    """Parameters of `VisualOdometryNode`."""

    height: float = param(
        0.0,
        "height of the camera above the ground, metres, which gives the scale; 0: unknown",
        min=0,
        max=1000,
        slider=(0, 10),
        restart=True,
    )
    scale_by: str = param(
        "", "other input that gives the scale: reference or fix; empty: none", restart=True
    )
    imu: bool = param(
        True, "use the IMU, if there is one, unless height or scale_by gives the scale"
    )
    stereo: bool = param(
        True,
        "use the right camera of a stereo pair, if there is one, unless height or scale_by gives"
        " the scale",
    )
    camera_clock: float = param(
        0.02,
        "standard deviation of the offset between the clocks of camera and IMU, seconds; the"
        " offset itself is estimated",
        min=0,
        max=1,
    )
    camera_focal: float = param(
        FOCAL_SIGMA,
        "standard deviation of the focal length, as a fraction; with an IMU, the focal length and"
        " the distortion are estimated; 0: the calibration is exact",
        min=0,
        max=0.3,
    )
    base_frame: str = param(
        "base_link", "frame whose motion is published; its transform to the camera is needed"
    )
    camera_turn: float = param(
        -1.0,
        "standard deviation of the error in the camera's attitude on the robot, degrees; below 0:"
        " 1.5 with an IMU (the error is then estimated), 0.5 without",
        min=-1,
        max=10,
    )
    corners: int = param(
        250, "number of corners to follow", min=50, max=2000, slider=(50, 1000), restart=True
    )
    readout: float = param(
        -1.0,
        "time from the first to the last row of a rolling shutter, seconds; 0: global shutter;"
        " below 0: unknown, so it is estimated if there is an IMU, and assumed to be 0 if not",
        min=-1,
        max=0.2,
        restart=True,
    )


@node(
    "visual_odometry",
    params=CameraMotionParams,
    inputs={"image": Image, "right": Image, "imu": Imu, "reference": Odometry, "fix": NavSatFix},
    outputs={
        "odometry": Odometry,
        "tf": Transforms,
        "points": PointCloud,
        "debug_image": Image,
        "diagnostics": DiagnosticArray,
    },
    topics={
        "odometry": "/visual_odometry/odom",
        "tf": "/visual_odometry/tf",
        "points": "/visual_odometry/points",
        "debug_image": "/visual_odometry/debug_image",
        "diagnostics": "/visual_odometry/diagnostics",
    },
    on_demand=("debug_image",),
    calibrated=True,
    frames=True,
    splittable=False,
)
class VisualOdometryNode:
    """Publishes the motion of a camera, in metres, with its covariance.

    The scale comes from a right camera, an IMU, the height over the ground, an odometry or fixes;
    while it is unknown, no odometry is published. With an IMU it starts at rest, or when the robot
    speeds up, slows down or turns. While the camera is lost, the pose by the IMU is published, or
    the last one, with a growing covariance.
    """

    def __init__(self, params: CameraMotionParams) -> None:
        self._params = params
        self._remarks = OnceLog("visual_odometry")
        self.reset()

    def reset(self) -> None:
        """Start over: time jumped."""
        self._odometry: VisualOdometry | None = None
        self._inertial: InertialInput | None = None
        self._has_imu = self._is_stereo = False
        self._pairs = StereoPairs[Image]()
        self._waiting: dict[int, tuple[Image, Pixels]] = {}
        self._locator = Locator()
        self._T_odom_first = np.eye(4)
        self._last: tuple[int, Floats] | None = None
        self._start_ns, self._keyframes = -1, 0
        self._is_placed = True
        self._is_gimbal = self._is_lens_wrong = False

    def step(
        self,
        params: CameraMotionParams,
        image: Image | None = None,
        right: Image | None = None,
        imu: Imu | None = None,
        reference: Odometry | None = None,
        fix: NavSatFix | None = None,
        *,
        frames: FrameTree,
    ) -> dict[str, Any] | None:
        """The motion up to an image."""
        if params != self._params:
            self._params = params
            self.reset()
        for name, message in (("reference", reference), ("fix", fix)):
            if message is not None and params.scale_by == name and self._odometry:
                self._measure(self._odometry, message)
        is_free = not (params.height or params.scale_by)
        if right is not None and params.stereo and is_free:
            return self._see_one(right, True, frames)
        if imu is not None and params.imu and is_free and not self._is_stereo:
            self._has_imu = True
            return self._feel(imu, frames)
        if image is None:
            return None
        return self._see_one(image, False, frames) if self._is_stereo else self._see(image, frames)

    def report(self) -> dict[str, Any]:
        """Numbers of images, keyframes and losses."""
        if self._inertial is not None:
            return dict(self._inertial.odometry.counts)
        return {} if self._odometry is None else dict(self._odometry.counts)

    def _measure(self, odometry: VisualOdometry, message: Odometry | NavSatFix) -> None:
        pose = self._locator.locate(message)
        if pose is not None:
            sigma = _FIX_M if isinstance(message, NavSatFix) else _ODOMETRY_M
            odometry.measured(message.header.stamp_ns, pose[:3], sigma)

    def _see_one(self, image: Image, is_right: bool, frames: FrameTree) -> dict[str, Any] | None:
        """The answer to a stereo pair, once both images have come."""
        if not self._is_stereo:
            self.reset()
            self._is_stereo = True
        pair = self._pairs.add(image.header.stamp_ns, image, is_right)
        return self._see(pair[0], frames, pair[1]) if pair else None

    def _see(
        self, image: Image, frames: FrameTree, right: Image | None = None
    ) -> dict[str, Any] | None:
        color.refuse_measurements(image.encoding)
        fit_threads(image.pixels)
        pixels = color.demosaiced(image.pixels, image.encoding)
        order = color.order_of(image.encoding)
        gray = to_8_bit(color.to_gray(pixels, order))
        header, info = image.header, image.camera_info
        if info is None:
            self._remarks.say("no odometry: the camera is not calibrated")
            return {}
        if self._has_imu:
            return self._see_with_imu(image, gray, info, frames)
        T_base_camera = self._mounting(header, frames)
        if self._odometry is None:
            cameras = [info] if right is None else self._two(image, right, frames)
            if not cameras:
                return {}
            self._odometry = self._begin(cameras, T_base_camera, frames)
        pose = self._odometry.step(header.stamp_ns, gray, _gray(right) if right else None)
        if pose is not None and self._odometry.start_ns != self._start_ns:
            self._start_ns = self._odometry.start_ns
            first = Header(self._start_ns, header.frame_id)
            self._T_odom_first = self._mounting(first, frames)
        self._odometry.done.clear()
        reason = self._odometry.reason
        if reason:
            self._remarks.say(reason)
        corners = self._odometry.corners
        shown = Deferred(
            (*gray.shape, 3), np.uint8, lambda: _draw(color.to_bgr(pixels, order), corners, reason)
        )
        answer = {
            "debug_image": replace(image, data=shown, encoding="bgr8"),
            "diagnostics": self._diagnostics(self._odometry, pose, header),
        }
        if pose is not None and pose.in_metres:
            answer |= self._answer(self._odometry, pose, T_base_camera)
            if self._odometry.counts["keyframes"] != self._keyframes:
                self._keyframes = self._odometry.counts["keyframes"]
                answer["points"] = self._points(self._odometry, header, self._T_odom_first)
        return answer

    # with an IMU

    def _feel(self, imu: Imu, frames: FrameTree) -> dict[str, Any] | None:
        if self._inertial is None:
            return None
        self._inertial.feel(imu, frames)
        return self._ready(self._inertial)

    def _see_with_imu(
        self, image: Image, gray: Pixels, info: CameraInfo, frames: FrameTree
    ) -> dict[str, Any] | None:
        p = self._params
        if self._inertial is None:
            turn = CAMERA_TURN if p.camera_turn < 0 else p.camera_turn
            errors = CameraErrors(p.camera_clock, np.radians(turn), MOVES_S, p.camera_focal)
            readout_s = None if p.readout < 0 else p.readout
            self._inertial = InertialInput(info, p.base_frame, p.corners, readout_s, errors)
        self._inertial.see(image.header, gray, frames)
        if self._inertial.problem:
            self._remarks.say(self._inertial.problem)
            return {}
        self._waiting[image.header.stamp_ns] = image, gray
        return self._ready(self._inertial)

    def _ready(self, inertial: InertialInput) -> dict[str, Any] | None:
        """The answer to the newest image that the IMU has reached."""
        answer: dict[str, Any] | None = None
        for stamp_ns, pose in inertial.odometry.ready():
            image, gray = self._waiting.pop(stamp_ns)
            corners, reason = inertial.odometry.corners, inertial.odometry.reason
            fault = inertial.odometry.lens_fault
            if fault and not self._is_lens_wrong:
                self._is_lens_wrong = True
                self._remarks.say(fault)
            if reason:
                self._remarks.say(reason)
            shown = Deferred((*gray.shape, 3), np.uint8, partial(_draw_gray, gray, corners, reason))
            values = {name: str(count) for name, count in inertial.odometry.counts.items()}
            values["corners"] = str(len(corners.ids))
            own = inertial.odometry.filter
            if own is not None and self._params.readout < 0:
                values["readout"] = own.readout.words
            if own is not None and self._params.camera_focal:
                values["focal length"] = inertial.odometry.focal_length
            answer = {
                "debug_image": replace(image, data=shown, encoding="bgr8"),
                "diagnostics": _status(reason or fault, values, image.header),
            }
            if pose is not None:
                message = odometry_of(pose, _FRAME, self._params.base_frame)
                moved = TransformStamped(
                    message.child_frame_id, message.position_xyz, message.quat_xyzw, message.header
                )
                answer |= {"odometry": message, "tf": Transforms((moved,))}
        return answer

    def _mounting(self, header: Header, frames: FrameTree) -> Floats:
        """T_base_camera at an image: a gimbal turns the camera."""
        try:
            return frames.lookup(self._params.base_frame, header.frame_id, header.stamp_ns)
        except NoTransform as error:
            if self._odometry is not None and self._is_placed:
                raise
            self._is_placed = False
            self._remarks.say(f"{error}; assuming that the camera faces forward")
            return se3.from_parts(_R_BASE_CAMERA, np.zeros(3))

    def _two(self, left: Image, right: Image, frames: FrameTree) -> list[CameraInfo]:
        """The calibrations of a stereo pair; none if it is no such pair."""
        infos = [one for one in (left.camera_info, right.camera_info) if one is not None]
        if len(infos) < 2:
            self._remarks.say("no odometry: the right camera is not calibrated")
        elif left.data.shape[:2] != right.data.shape[:2]:
            self._remarks.say("no odometry: the images of the stereo pair differ in size")
        elif right_of(infos[0], infos[1], frames) is None:
            self._remarks.say(
                "no odometry: no calibration or transform places"
                f" {right.header.frame_id or 'the right camera'} to the right of the other camera"
            )
        else:
            return infos
        return []

    def _begin(
        self, infos: list[CameraInfo], T_base_camera: Floats, frames: FrameTree
    ) -> VisualOdometry:
        p = self._params
        T = right_of(infos[0], infos[1], frames) if len(infos) > 1 else None
        cameras = None if T is None else np.stack([np.eye(4), T])
        down = T_base_camera[:3, :3].T @ [0.0, 0, -1]
        settings = VisualSettings(
            corners=p.corners,
            height=p.height,
            down=(float(down[0]), float(down[1]), float(down[2])),
            readout_s=max(p.readout, 0.0),
            has_positions=bool(p.scale_by),
        )
        return VisualOdometry(infos, cameras, settings)

    def _answer(
        self, odometry: VisualOdometry, pose: VisualPose, T_base_camera: Floats
    ) -> dict[str, Any]:
        first = self._T_odom_first
        self._is_gimbal |= not np.allclose(first, T_base_camera, atol=_AT_REST)
        T = first @ se3.from_parts(pose.R, pose.p) @ se3.inverse(T_base_camera)
        ahead = se3.adjoint(first[:3, :3], first[:3, 3])
        covariance = ahead @ pose.covariance @ ahead.T + self._by_mounting(T, T_base_camera)
        change = se3.about_itself(T[:3, 3])
        covariance = change @ covariance @ change.T
        linear, angular, of_twist = self._twist(odometry, pose, T, T_base_camera)
        position, quat = se3.to_pose(T)
        at, base = Header(pose.stamp_ns, _FRAME), self._params.base_frame
        message = Odometry(position, quat, linear, angular, covariance, of_twist, base, at)
        moved = TransformStamped(base, position, quat, at)
        return {"odometry": message, "tf": Transforms((moved,))}

    def _by_mounting(self, T: Floats, T_base_camera: Floats) -> Floats:
        """(6, 6) covariance of the twist of a pose by the camera's attitude on the robot.

        Seen by a camera that is turned by e, a motion is turned: E T E^-1. A gimbal errs anew at
        each image, so the two turns, about the first place of the camera and about the last, do
        not cancel then.
        """
        if self._is_gimbal:
            places = self._T_odom_first[:3, 3], (T @ T_base_camera)[:3, 3]
            turns = np.hstack([se3.adjoint(np.eye(3), one)[:, 3:] for one in places])
        else:
            turns = np.eye(6)[:, 3:] - se3.adjoint(T[:3, :3], T[:3, 3])[:, 3:]
        stated = self._params.camera_turn
        turn_rad = np.deg2rad(_USUAL_TURN if stated < 0 else stated)
        covariance: Floats = turn_rad**2 * turns @ turns.T
        return covariance

    def _twist(
        self, odometry: VisualOdometry, pose: VisualPose, T: Floats, T_base_camera: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Velocities in the base's axes since the last image, and their covariance (6, 6)."""
        last, self._last = self._last, None if pose.is_lost else (pose.stamp_ns, T)
        seconds = (pose.stamp_ns - last[0]) / 1e9 if last else 0.0
        if pose.is_lost or last is None or seconds <= 0:
            return np.zeros(3), np.zeros(3), np.eye(6) * _UNKNOWN
        motion = se3.inverse(last[1]) @ T
        linear = motion[:3, 3] / seconds
        angular = se3.rotation_vector(motion[:3, :3]) / seconds
        ahead = se3.adjoint(T_base_camera[:3, :3], T_base_camera[:3, 3])
        covariance = ahead @ odometry.motion_covariance @ ahead.T / seconds**2
        covariance[:3, :3] += _SCALE**2 * np.outer(linear, linear)
        return linear, angular, covariance

    @staticmethod
    def _points(odometry: VisualOdometry, header: Header, T_odom_first: Floats) -> PointCloud:
        points = se3.apply(T_odom_first, odometry.points())
        cloud = np.empty(len(points), _POINT)
        for axis, column in zip("xyz", points.T, strict=True):
            cloud[axis] = column
        return PointCloud(cloud, header=Header(header.stamp_ns, _FRAME))

    @staticmethod
    def _diagnostics(odometry: VisualOdometry, pose: VisualPose | None, header: Header) -> Any:
        message = odometry.reason
        if not message and pose is not None and not pose.in_metres:
            message = "scale unknown: publishing no odometry"
        values = {name: str(count) for name, count in odometry.counts.items()}
        values["corners"] = str(len(odometry.corners.ids))
        return _status(message, values, header)


def _gray(image: Image) -> Pixels:
    pixels = color.demosaiced(image.pixels, image.encoding)
    return to_8_bit(color.to_gray(pixels, color.order_of(image.encoding)))


def _status(problem: str, values: dict[str, str], header: Header) -> DiagnosticArray:
    level = Level.WARN if problem else Level.OK
    status = DiagnosticStatus("visual_odometry", level, problem or "located", values)
    return DiagnosticArray((status,), Header(header.stamp_ns))


def _draw_gray(gray: Pixels, corners: FollowedCorners, reason: str) -> Pixels:
    return _draw(cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR), corners, reason)


def _draw(bgr: Pixels, corners: FollowedCorners, reason: str) -> Pixels:
    """The image with the ways of its corners since the one before, and why there is no pose."""
    image: Pixels = bgr.copy()
    new = np.isnan(corners.before_uv[:, 0])
    before = np.where(new[:, None], corners.pixels_uv, corners.before_uv)
    for start, end, is_new in zip(before, corners.pixels_uv, new, strict=True):
        shade = _NEW if is_new else _FOLLOWED
        a, b = (tuple(map(round, one.tolist())) for one in (start, end))
        cv2.line(image, a, b, shade, 1, cv2.LINE_AA)
        cv2.circle(image, b, 2, shade, -1, cv2.LINE_AA)
    if reason:
        cv2.putText(image, reason, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.5, _LOST, 1, cv2.LINE_AA)
    return image

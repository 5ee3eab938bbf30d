"""The node that estimates the pose of the landing target relative to the robot."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import param
from ros_visualise.data import (
    Detections,
    Floats,
    Header,
    Odometry,
    PoseStamped,
    PoseWithCovarianceStamped,
)
from ros_visualise.estimation.landing.relative import Autopilot, relative_to
from ros_visualise.estimation.landing.tracking import (
    STEADY,
    TargetMotion,
    TargetTracker,
)
from ros_visualise.estimation.localization.estimate import POSE, LandmarkEstimate
from ros_visualise.estimation.localization.robot_error import ErrorModel
from ros_visualise.estimation.localization.seen import Ground, sighting_of
from ros_visualise.estimation.steadiness import words
from ros_visualise.geometry import rotations
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.landmarks.once_log import OnceLog
from ros_visualise.nodes import node

_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class LandingTargetParams:
    """Parameters of `LandingTarget`."""

    target: str = param(
        "pad",
        "landing target: the name of a tag, of a bundle, or of a class of objects with the origin"
        " in the middle, such as pad, helipad",
    )
    rate: float = param(
        20.0,
        "rate at which predictions from odometry are published between images, Hz; 0: none",
        min=0,
        max=200,
    )
    timeout: float = param(
        1.0, "time after which an unseen target counts as lost, seconds", min=0.05, max=60
    )
    autopilot: Autopilot = param(
        Autopilot.NONE,
        "frame of the pose: none, relative to the body, forward, left, up (REP 103); ardupilot,"
        " relative to the body, forward, right, down (MAV_FRAME_BODY_FRD); px4, in the fixed frame,"
        " north, east, down (MAV_FRAME_LOCAL_NED)",
    )
    frame: str = param("base_link", "body frame; for ardupilot, _frd is appended to its name")
    fixed_frame: str = param(
        "odom",
        "frame in which the target is still or moves steadily; for px4: x east, y north,"
        " z up, with PX4's local origin; the pose's frame is then this name with _ned appended",
    )
    speed: float = param(
        1.0,
        "standard deviation of the target's speed, m/s; 0: the target does not move",
        min=0,
        max=50,
        slider=(0, 5),
        group="motion",
    )
    acceleration: float = param(
        0.5,
        "standard deviation of the change in the target's speed in one second, m/s",
        min=0.001,
        max=50,
        slider=(0, 5),
        group="motion",
    )
    drift: float = param(
        0.01,
        "standard deviation of the drift of the fixed frame in one second, metres",
        min=0,
        max=10,
        slider=(0, 0.2),
        group="motion",
    )
    patience: float = param(
        0.5,
        "time for which sightings must contradict the estimate before they replace it, seconds",
        min=0.01,
        max=60,
        slider=(0.1, 5),
        group="motion",
    )
    attitude_sigma: float = param(
        0.5,
        "standard deviation of the camera's attitude, degrees; raised if the images show larger"
        " errors",
        min=0,
        max=45,
        slider=(0, 5),
        group="uncertainty",
    )
    attitude_time: float = param(
        20.0,
        "time constant of the camera's attitude error, seconds",
        min=0.01,
        max=1e9,
        slider=(1, 600),
        group="uncertainty",
    )
    ground_height: float = param(
        0.0,
        "height assumed for the target in the fixed frame until its distance is measured, metres",
        min=-1e4,
        max=1e4,
        slider=(-10, 10),
        group="uncertainty",
    )
    ground_sigma: float = param(
        0.5,
        "standard deviation of ground_height, metres",
        min=0.01,
        max=1e3,
        slider=(0.01, 5),
        group="uncertainty",
    )

    def __post_init__(self) -> None:
        if not self.names:
            raise ParameterError(f"target={self.target!r}: give a landing target, such as pad")

    @property
    def names(self) -> set[str]:
        """The classes to land on."""
        return {name.strip() for name in self.target.split(",")} - {""}

    @property
    def pose_frame(self) -> str:
        """The frame of the target's pose."""
        frames = {
            Autopilot.ARDUPILOT: f"{self.frame}_frd",
            Autopilot.PX4: f"{self.fixed_frame}_ned",
        }
        return frames.get(self.autopilot, self.frame)


@node(
    "landing_target",
    params=LandingTargetParams,
    inputs={"detections": Detections, "objects": Detections, "odom": Odometry},
    outputs={
        "landing_target": PoseWithCovarianceStamped,
        "landing_target_pose": PoseStamped,
        "landing_target_odom": Odometry,
    },
    frames=True,
    splittable=False,
)
class LandingTarget:
    """Estimates the pose of the landing target relative to the robot, even between images.

    It publishes nothing while the target is lost. ``landing_target_odom`` is the odometry of the
    target, with its velocity, in the fixed frame.

    While sightings contradict the estimate, the covariance includes where they are; if they do so
    for longer than the parameter ``patience``, or from the start, they replace it.
    """

    def __init__(self, params: LandingTargetParams) -> None:
        self._tracker = TargetTracker()
        self._published_ns = 0
        self._answers = self._losses = 0
        self._remarks = OnceLog("landing_target")

    def reset(self) -> None:
        """Start over: time jumped."""
        self._tracker.forget()
        self._published_ns = 0

    def step(
        self,
        params: LandingTargetParams,
        detections: Detections | None = None,
        objects: Detections | None = None,
        odom: Odometry | None = None,
        *,
        frames: FrameTree,
    ) -> dict[str, Any] | None:
        """The target's pose at the time of an image or of an odometry."""
        found = objects if detections is None else detections
        if found is not None:
            self._observe(found, params, frames)
            return self._estimate(found.header.stamp_ns, params, frames)
        if odom is None or not params.rate:
            return None
        stamp_ns = odom.header.stamp_ns
        if stamp_ns - self._published_ns < 1e9 / params.rate:
            return None
        return self._estimate(stamp_ns, params, frames)

    def report(self) -> dict[str, Any]:
        """Numbers of estimates, of rejected sightings, of estimates that these replaced, and of
        losses of the target.
        """
        tracker = self._tracker
        counts = {"answers": self._answers, "refused": tracker.refused}
        return {**counts, "replaced": tracker.replaced, "losses": self._losses}

    def _observe(self, found: Detections, params: LandingTargetParams, frames: FrameTree) -> None:
        names = params.names
        stamp_ns = found.header.stamp_ns
        ours = [
            [h for h in one.hypotheses if h.class_id in names]
            for one in found.detections
            if names & {h.class_id for h in one.hypotheses}
        ]
        if not ours:
            return
        self._drop_if_lost(stamp_ns, params)
        T_fixed_camera = frames.lookup(params.fixed_frame, found.header.frame_id, stamp_ns)
        ground = Ground(_UP, params.ground_height, params.ground_sigma)
        for hypotheses in ours:
            readings = [sighting_of(one, T_fixed_camera) for one in hypotheses]
            known = [one for one in readings if one is not None]
            replaced, level = self._tracker.replaced, self._tracker.steadiness.level
            self._tracker.observe(stamp_ns, known, _motion(params), ground, _camera(params))
            if self._tracker.replaced > replaced:
                self._remarks.say(
                    f"estimate of {params.target} replaced, because sightings contradict it"
                )
            if self._tracker.steadiness.level > level:
                self._warn_of_camera(params)

    def _estimate(
        self, stamp_ns: int, params: LandingTargetParams, frames: FrameTree
    ) -> dict[str, Any] | None:
        self._drop_if_lost(stamp_ns, params)
        estimate = self._tracker.at(stamp_ns, _motion(params))
        if estimate is None:
            return None
        T_fixed_body = frames.lookup(params.fixed_frame, params.frame, stamp_ns)
        self._published_ns = stamp_ns
        self._answers += 1
        pose = relative_to(T_fixed_body, estimate, params.autopilot)
        header = Header(stamp_ns, params.pose_frame)
        return {
            "landing_target": PoseWithCovarianceStamped(*pose, header),
            "landing_target_pose": PoseStamped(*pose[:2], header),
            "landing_target_odom": _odometry(estimate, Header(stamp_ns, params.fixed_frame)),
        }

    def _warn_of_camera(self, params: LandingTargetParams) -> None:
        now = _camera(params).at_level(self._tracker.steadiness.level)
        assumed = words(now.attitude_rad, now.attitude_s)
        self._remarks.say(f"the camera is less steady than attitude_sigma says; {assumed}")

    def _drop_if_lost(self, stamp_ns: int, params: LandingTargetParams) -> None:
        tracker = self._tracker
        seen_ns = tracker.seen_ns
        if seen_ns is None or stamp_ns - seen_ns <= params.timeout * 1e9:
            return
        tracker.forget()
        self._losses += 1
        self._remarks.say(f"{params.target} is lost: not seen for {params.timeout:g} s")


def _motion(p: LandingTargetParams) -> TargetMotion:
    return TargetMotion(p.speed, p.acceleration, drift=p.drift, patience_s=p.patience)


def _camera(p: LandingTargetParams) -> ErrorModel:
    return replace(STEADY, attitude_rad=math.radians(p.attitude_sigma), attitude_s=p.attitude_time)


def _odometry(estimate: LandmarkEstimate, header: Header) -> Odometry:
    """The target's own odometry; its velocity is in its own axes, as that of all odometry."""
    R = estimate.R_fixed_landmark
    twist: Floats = np.zeros((6, 6))
    twist[:3, :3] = R.T @ estimate.covariance[6:, 6:] @ R
    return Odometry(
        estimate.position_xyz,
        rotations.from_matrix(R),
        R.T @ estimate.velocity_xyz,
        pose_covariance=estimate.covariance[POSE, POSE],
        twist_covariance=twist,
        child_frame_id="landing_target",
        header=header,
    )

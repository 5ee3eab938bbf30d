"""The node that localizes the robot in a map of landmarks."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ros_visualise.core.errors import NoTransform, OpenError
from ros_visualise.data import (
    Detections,
    Detections3D,
    DiagnosticArray,
    Floats,
    Header,
    Imu,
    MarkerArray,
    NavSatFix,
    Odometry,
    PoseWithCovarianceStamped,
    Transforms,
    TransformStamped,
)
from ros_visualise.geometry import rigid, se3
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.landmarks.localization import map_file
from ros_visualise.landmarks.localization.track import LandmarkTrack
from ros_visualise.landmarks.navigation import messages
from ros_visualise.landmarks.navigation.camera_view import view_of
from ros_visualise.landmarks.navigation.imu import ImuMounting
from ros_visualise.landmarks.navigation.landmark import KnownLandmark
from ros_visualise.landmarks.navigation.landmark_map import MapMode
from ros_visualise.landmarks.navigation.navigator import Navigator, RobotEstimate
from ros_visualise.landmarks.navigation.params import NavigatorParams
from ros_visualise.landmarks.navigation.rejections import Rejections
from ros_visualise.landmarks.navigation.settings import NavigatorSettings
from ros_visualise.nodes import action, node
from ros_visualise.nodes.landmark_localizer import save_landmarks

log = logging.getLogger(__name__)

_MAP = "map"  # REP 105
_TWO_PUBLISH = (
    "another node already publishes {0} -> {1}: starting from its last value; stop it (of a"
    " recording, play it without its localization)"
)
_SHOWN_NS = 200_000_000  # between diagnostics and markers


@node(
    "landmark_navigator",
    params=NavigatorParams,
    inputs={
        "detections": Detections,
        "objects": Detections,
        "odometry": Odometry,
        "imu": Imu,
        "gps": NavSatFix,
    },
    outputs={
        "pose": PoseWithCovarianceStamped,
        "tf": Transforms,
        "landmarks": Detections3D,
        "markers": MarkerArray,
        "diagnostics": DiagnosticArray,
    },
    topics={
        "pose": "/navigation/pose",
        "tf": "/navigation/tf",
        "markers": "/landmark_markers",
        "diagnostics": "/navigation/diagnostics",
    },
    frames=True,
)
class LandmarkNavigator:
    """Corrects the odometry by landmarks: publishes map -> odom, and the robot's pose in the map.

    An IMU, if any, propagates the pose between odometries; GPS, if any, corrects it too.
    """

    def __init__(self, params: NavigatorParams) -> None:
        self._begun = rigid.IDENTITY
        self._open(params)
        self.reset()

    def _open(self, params: NavigatorParams) -> None:
        self._params, self._settings = params, params.settings()
        self._given: dict[str, LandmarkTrack] = {}
        self._frame, self._common = _MAP, np.zeros((6, 6))
        if params.mode is MapMode.BUILD:
            return
        if not params.map:
            raise OpenError(f"mode {params.mode.value} needs a map; give its file as map")
        self._frame, several, self._common = map_file.load(Path(params.map))
        self._given = _named(several)
        self._settings = _on(self._settings, self._common)

    def reset(self) -> None:
        """Start over: time jumped."""
        self._navigator: Navigator | None = None
        self._odom_frame = self._base_frame = ""
        self._now: RobotEstimate | None = None
        self._shown_ns: int | None = None
        self._state = ""
        self._mounted: dict[str, ImuMounting | None] = {}
        self._rejections = Rejections()

    @action("write the landmarks to the file save_to")
    def save_map(self) -> None:
        """Write the map; replace its former file when it is complete."""
        tracks, common = (
            messages.tracks_of(self._navigator, self._given) if self._navigator else ([], None)
        )
        save_landmarks(self._params.save_to, self._frame, tracks, common)

    def step(
        self,
        params: NavigatorParams,
        detections: Detections | None = None,
        objects: Detections | None = None,
        odometry: Odometry | None = None,
        imu: Imu | None = None,
        gps: NavSatFix | None = None,
        *,
        frames: FrameTree,
    ) -> dict[str, Any] | None:
        """The robot's pose for each odometry; the landmarks for images."""
        if params is not self._params:
            self._change(params)
        answer: dict[str, Any] = {}
        if odometry is not None:
            answer = self._go_on(odometry, frames)
        elif self._navigator is None:
            return None
        elif imu is not None and params.imu:
            self._feel(self._navigator, imu, frames)
        elif gps is not None and params.gps:
            self._locate(self._navigator, gps, frames)
        elif detections is not None:
            self._see(self._navigator, detections, params.class_prefix, frames)
        elif objects is not None:
            self._see(self._navigator, objects, params.object_prefix, frames)
        return (answer | self._shown()) or None

    def _see(
        self, navigator: Navigator, detections: Detections, prefix: str, frames: FrameTree
    ) -> None:
        header, p = detections.header, self._params
        T = frames.lookup(self._base_frame, header.frame_id, header.stamp_ns)
        navigator.see(view_of(detections, T, prefix, p.corner_floor, p.moving_classes))

    def _feel(self, navigator: Navigator, imu: Imu, frames: FrameTree) -> None:
        mounting = self._mounting(imu.header, frames)
        measured = imu.angular_covariance[0, 0] >= 0 and imu.linear_covariance[0, 0] >= 0
        if mounting is None or not measured:
            return
        navigator.imu(imu.header.stamp_ns, imu.angular_xyz, imu.linear_xyz, mounting)

    def _locate(self, navigator: Navigator, gps: NavSatFix, frames: FrameTree) -> None:
        mounting = self._mounting(gps.header, frames)
        if gps.status < 0 or mounting is None:
            return
        geodetic = np.array([gps.latitude, gps.longitude, gps.altitude])
        known = gps.covariance if gps.covariance_type else np.zeros((3, 3))
        navigator.fix(gps.header.stamp_ns, geodetic, known, mounting.p)

    def _mounting(self, header: Header, frames: FrameTree) -> ImuMounting | None:
        """The pose of a sensor on the robot; None and one warning if unknown."""
        name = header.frame_id
        if name not in self._mounted:
            self._mounted[name] = None
            try:
                T = frames.lookup(self._base_frame, name, header.stamp_ns)
                self._mounted[name] = ImuMounting(T[:3, :3], T[:3, 3])
            except NoTransform as error:
                log.warning("ignoring %s: %s", name or "a sensor without a frame", error)
        return self._mounted[name]

    def _change(self, params: NavigatorParams) -> None:
        """Continue with other parameters; with another map, begin anew."""
        before, self._params = self._params, params
        if (params.mode, params.map) != (before.mode, before.map):
            self._open(params)
            self.reset()
            return
        self._settings = _on(params.settings(), self._common)
        if self._navigator is not None:
            self._navigator.configure(self._settings)

    def report(self) -> dict[str, Any]:
        """Numbers of images used, of losses and of landmarks."""
        if self._navigator is None:
            return {}
        landmarks = self._navigator.landmark_map.landmarks.values()
        return {**self._navigator.counts, "landmarks": sum(one.is_used for one in landmarks)}

    def _go_on(self, odometry: Odometry, frames: FrameTree) -> dict[str, Any]:
        header = odometry.header
        if self._navigator is None:
            self._odom_frame, self._base_frame = header.frame_id, odometry.child_frame_id
            start = self._start(frames, header)
            given = _known(self._given, self._common)
            self._navigator = Navigator(self._settings, given, start, self._common)
        pose = rigid.pose(odometry.position_xyz, odometry.quat_xyzw)
        now = self._navigator.odometry(header.stamp_ns, pose)
        if now is None:
            return {}
        self._now = now
        place, quat = se3.to_pose(now.T_map_odom)
        at = Header(header.stamp_ns, self._frame)
        answer: dict[str, Any] = {
            "tf": Transforms((TransformStamped(self._odom_frame, place, quat, at),))
        }
        if now.is_located:
            place, quat = se3.to_pose(now.T_map_base)
            answer["pose"] = PoseWithCovarianceStamped(place, quat, now.covariance, at)
        return answer

    def _start(self, frames: FrameTree, header: Header) -> rigid.Pose:
        """T_map_odom if the start of the odometry is published, else the identity.

        A frame odom_start, as that of simulated robots, goes first. It holds again after a jump
        of time.
        """
        for frame in (f"{header.frame_id}_start", header.frame_id):
            with suppress(NoTransform):
                T = frames.lookup(self._frame, frame, header.stamp_ns)
                self._begun = rigid.pose(*se3.to_pose(T))
                if frame == header.frame_id:
                    log.warning("%s", _TWO_PUBLISH.format(self._frame, frame))
                break
        return self._begun

    def _shown(self) -> dict[str, Any]:
        """Diagnostics and markers: now and then, and at once if the state changed."""
        navigator = self._navigator
        if navigator is None or not navigator.has_news:
            return {}
        navigator.has_news = False
        for text in self._rejections.look(navigator.outcome):
            log.warning("landmark_navigator: %s (further occurrences suppressed)", text)
        at = Header(navigator.at_ns, self._frame)
        state = f"{navigator.reason} {sorted(navigator.outcome.rejected)}"
        is_due = self._shown_ns is None or at.stamp_ns - self._shown_ns >= _SHOWN_NS
        if not is_due and state == self._state:
            return {}
        self._shown_ns, self._state = at.stamp_ns, state
        answer: dict[str, Any] = {"diagnostics": messages.diagnostics_of(navigator, self._now, at)}
        if self._now is not None:
            answer["landmarks"] = messages.landmarks_of(navigator, at)
            answer["markers"] = messages.markers_of(navigator, self._now, at)
        return answer


def _named(tracks: Iterable[LandmarkTrack]) -> dict[str, LandmarkTrack]:
    """Landmarks by name; names of points of one class end in a number."""
    numbered = (replace(one, number=n) for n, one in enumerate(tracks, 1))
    return {one.name: one for one in numbered}


def _on(settings: NavigatorSettings, common: Floats) -> NavigatorSettings:
    """The same over a map whose tilt has this covariance (6, 6)."""
    tilt = float(np.sqrt(common[[3, 4], [3, 4]].max()))
    return replace(settings, level_rad=float(np.hypot(settings.level_rad, tilt)))


def _known(tracks: Mapping[str, LandmarkTrack], common: Floats) -> dict[str, KnownLandmark]:
    """The landmarks of a map, with their errors beside the common one."""
    return {name: _known_one(one, common) for name, one in tracks.items()}


def _known_one(one: LandmarkTrack, common: Floats) -> KnownLandmark:
    at, R = one.best.position_xyz, one.best.R_fixed_landmark
    if one.turned:
        return KnownLandmark.of(R, at, one.covariance, float(one.size_xyz[:2].mean()), common)
    return KnownLandmark.point(at, one.covariance, one.class_id, one.class_number)

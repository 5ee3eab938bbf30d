"""The node that localizes the robot in a map of landmarks."""

from __future__ import annotations

import logging
from collections import Counter
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
    Odometry,
    PoseWithCovarianceStamped,
    Transforms,
    TransformStamped,
)
from ros_visualise.estimation import messages
from ros_visualise.estimation.camera_view import PLACE, turning_of, view_of
from ros_visualise.estimation.imu import Mounting
from ros_visualise.estimation.initial_pose import InitialPose, pose_of_message
from ros_visualise.estimation.landmark import KnownLandmark
from ros_visualise.estimation.landmark_map import MapMode
from ros_visualise.estimation.localization import map_file
from ros_visualise.estimation.localization.track import LandmarkTrack
from ros_visualise.estimation.measuring import CAMERAS
from ros_visualise.estimation.navigator import Navigator, RobotEstimate
from ros_visualise.estimation.params import NavigatorParams
from ros_visualise.estimation.rejections import Rejections
from ros_visualise.estimation.reported_errors import reported_variances
from ros_visualise.estimation.sensors import SENSORS, Reading
from ros_visualise.estimation.settings import NavigatorSettings
from ros_visualise.geometry import rigid, se3
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.nodes import action, node
from ros_visualise.nodes.landmark_localizer import save_landmarks

log = logging.getLogger(__name__)

_MAP = "map"  # REP 105
_TWO_PUBLISH = (
    "another node already publishes {0} -> {1}; this node starts from the last value published."
    " Stop the other node or, if the transform comes from a recording, play it without this"
    " transform"
)
_RENAMED = "%s: its frame %s is also that of the odometry; using the frame %s for the map"
_ODOMETRY_IN_MAP = (
    "the odometry is in the frame map, which is that of the landmarks; publishing no transform;"
    " publish the odometry in another frame, such as odom"
)
_NO_MOUNTING = "no transform to the robot"
_SHOWN_NS = 200_000_000  # between diagnostics and markers


@node(
    "landmark_navigator",
    params=NavigatorParams,
    inputs={
        "detections": Detections,
        "objects": Detections,
        "places": Detections,
        "odometry": Odometry,
        "imu": Imu,
        "initialpose": PoseWithCovarianceStamped,
        **{sensor.name: sensor.message for sensor in SENSORS.all()},
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
    splittable=False,
)
class LandmarkNavigator:
    """Corrects odometry using landmarks: publishes map -> odom, and the robot's pose in the map.

    An IMU, if any, propagates the pose between odometries; GPS, if any, corrects it too.
    """

    def __init__(self, params: NavigatorParams) -> None:
        self._open(params)

    def _open(self, params: NavigatorParams) -> None:
        """Begin with a map, or without one."""
        self._params, self._settings = params, params.settings()
        self._given: dict[str, LandmarkTrack] = {}
        self._frame, self._common = _MAP, np.zeros((6, 6))
        self._navigator: Navigator | None = None
        self._start: rigid.Pose | None = None
        self._forget()
        self._stated: InitialPose | PoseWithCovarianceStamped | None = params.stated
        if params.mode is MapMode.BUILD:
            return
        if not params.map:
            raise OpenError(
                f"mode {params.mode.value} needs a map; set the parameter 'map' to its file"
            )
        self._frame, several, self._common = map_file.load(Path(params.map))
        self._given = _named(several)
        self._settings = _on(self._settings, self._common)

    def _forget(self) -> None:
        self._odom_frame = self._base_frame = ""
        self._now: RobotEstimate | None = None
        self._stated = None
        self._last: Odometry | None = None
        self._shown_ns: int | None = None
        self._state, self._images, self._is_due = "", 0, False
        self._mounted: dict[str, Mounting] = {}
        self._cameras: list[str] = []
        self._unused: Counter[str] = Counter()
        self._rejections = Rejections()
        self._messages = messages.RenewedMessages()

    def reset(self) -> None:
        """Start over: time jumped. The map built so far is kept."""
        if self._navigator is not None and self._navigator.map.used:
            self._navigator.reset()
        else:
            self._navigator = None
        self._forget()

    @action("write the landmarks to the file that save_to names")
    def save_map(self, params: NavigatorParams) -> None:
        """Write the map; replace its former file when it is complete."""
        tracks, common = (
            messages.tracks_of(self._navigator, self._given) if self._navigator else ([], None)
        )
        save_landmarks(params.save_to, self._frame, tracks, common)

    def step(
        self,
        params: NavigatorParams,
        detections: Detections | None = None,
        objects: Detections | None = None,
        places: Detections | None = None,
        odometry: Odometry | None = None,
        imu: Imu | None = None,
        initialpose: PoseWithCovarianceStamped | None = None,
        *,
        frames: FrameTree,
        **others: Any,
    ) -> dict[str, Any] | None:
        """The robot's pose for each odometry; the landmarks for images."""
        if params is not self._params:
            self._change(params)
        answer: dict[str, Any] = {}
        if odometry is not None:
            answer = self._go_on(odometry, frames)
            self._place_robot()
        elif initialpose is not None:
            self._stated = initialpose
            self._place_robot()
        elif self._navigator is None or not self._base_frame:  # no odometry since the last reset
            return None
        elif imu is not None:
            self._feel(self._navigator, imu, frames)
        elif detections is not None:
            self._see(self._navigator, detections, params.class_prefix, frames)
        elif objects is not None:
            self._see(self._navigator, objects, params.object_prefix, frames)
        elif places is not None:
            self._see(self._navigator, places, PLACE, frames)
        for name, message in others.items():
            self._read(name, message, frames)
        is_image = any(one is not None for one in (detections, objects, places))
        return (answer | ({} if is_image else self._landmarks()) | self._shown()) or None

    def _place_robot(self) -> None:
        """Put the robot where the user states, once there is odometry."""
        stated, navigator = self._stated, self._navigator
        if stated is None or navigator is None or self._last is None:
            return
        self._stated = None
        if isinstance(stated, PoseWithCovarianceStamped):
            found = pose_of_message(stated, self._frame)
            if isinstance(found, str):
                log.warning("ignoring the initial pose: %s", found)
                return
            stated = found
        if not navigator.place(stated):
            log.warning("ignoring the initial pose: the odometry has stopped")
            return
        x, y, _ = stated.position_xyz
        log.info("initial pose: x %.2f, y %.2f m in %s", x, y, self._frame)

    def _see(
        self, navigator: Navigator, detections: Detections, prefix: str, frames: FrameTree
    ) -> None:
        header, p = detections.header, self._params
        T = frames.lookup(self._base_frame, header.frame_id, header.stamp_ns)
        if header.frame_id not in self._cameras:
            self._cameras.append(header.frame_id)
        camera = min(self._cameras.index(header.frame_id), len(CAMERAS) - 1)
        turning = turning_of(frames, self._base_frame, header, T)
        view = view_of(detections, T, prefix, p.corner_floor, p.moving_classes, camera, turning)
        navigator.see(view)

    def _feel(self, navigator: Navigator, imu: Imu, frames: FrameTree) -> None:
        mounting = self._mounting("imu", imu.header, frames)
        measured = imu.angular_covariance[0, 0] >= 0 and imu.linear_covariance[0, 0] >= 0
        if mounting is None or not measured:
            self._unused[
                "imu: " + _NO_MOUNTING if mounting is None else "imu: measures nothing"
            ] += 1
            return
        navigator.imu(imu.header.stamp_ns, imu.angular_xyz, imu.linear_xyz, mounting)

    def _read(self, name: str, message: Any, frames: FrameTree) -> None:
        """Process a message of another sensor."""
        sensor = SENSORS.find(name)
        if self._navigator is None or not getattr(self._params, name, True):
            return
        mounting = self._mounting(name, message.header, frames)
        found = sensor.read(message, self._params) if mounting else _NO_MOUNTING
        if mounting is None or isinstance(found, str):
            self._unused[f"{name}: {found}"] += 1
            return
        self._navigator.read(Reading(name, message.header.stamp_ns, *found, mounting))

    def _mounting(self, name: str, header: Header, frames: FrameTree) -> Mounting | None:
        """The pose of a sensor on the robot; None and one warning while it is unknown."""
        frame = header.frame_id
        if frame not in self._mounted:
            try:
                T = frames.lookup(self._base_frame, frame, header.stamp_ns)
            except NoTransform as error:
                if not self._unused[f"{name}: {_NO_MOUNTING}"]:
                    log.warning("ignoring %s until its frame is known: %s", name, error)
                return None
            self._mounted[frame] = Mounting(T[:3, :3], T[:3, 3])
        return self._mounted[frame]

    def _change(self, params: NavigatorParams) -> None:
        """Continue with other parameters; with another map or start, begin anew."""
        before, self._params = self._params, params
        if not params.begins_as(before):
            if self._navigator is not None and self._navigator.map.used:
                built = len(self._navigator.map.used)
                log.warning("beginning anew: the map of %d landmarks is dropped", built)
            self._open(params)
            return
        self._settings = _on(params.settings(), self._common)
        if self._navigator is not None:
            self._navigator.configure(self._settings)

    def report(self) -> dict[str, Any]:
        """Numbers of images used, of losses and of landmarks."""
        if self._navigator is None:
            return {}
        counts = {**self._navigator.counts, **self._unused}
        return {**counts, "landmarks": len(self._navigator.map.used)}

    def _go_on(self, odometry: Odometry, frames: FrameTree) -> dict[str, Any]:
        header = odometry.header
        if not self._base_frame:
            self._odom_frame, self._base_frame = header.frame_id, odometry.child_frame_id
            self._keep_frames_apart()
        if self._navigator is None:
            start = self._begun(frames, header)
            given = _known(self._given, self._common)
            self._navigator = Navigator(self._settings, given, start, self._common)
        pose = rigid.pose(odometry.position_xyz, odometry.quat_xyzw)
        variances = reported_variances(odometry, self._last)
        self._last = odometry
        now = self._navigator.odometry(header.stamp_ns, pose, variances)
        if now is None:
            return {}
        self._now = now
        place, quat = se3.to_pose(now.T_map_odom)
        at = Header(header.stamp_ns, self._frame)
        answer: dict[str, Any] = {}
        if self._frame != self._odom_frame:
            answer["tf"] = Transforms((TransformStamped(self._odom_frame, place, quat, at),))
        if now.is_located:
            place, quat = se3.to_pose(now.T_map_base)
            answer["pose"] = PoseWithCovarianceStamped(place, quat, now.covariance, at)
        return answer

    def _keep_frames_apart(self) -> None:
        """Rename the map's frame if it is that of the odometry, as of maps made without tf."""
        if self._frame != self._odom_frame:
            return
        if self._frame == _MAP:
            log.warning("%s", _ODOMETRY_IN_MAP)
            return
        log.warning(_RENAMED, self._params.map, self._frame, _MAP)
        self._frame = _MAP

    def _begun(self, frames: FrameTree, header: Header) -> rigid.Pose | None:
        """T_map_odom if the start of the odometry is published; None if it is not.

        A frame odom_start, as that of simulated robots, goes first. It holds again after a jump
        of time.
        """
        for frame in (f"{header.frame_id}_start", header.frame_id):
            with suppress(NoTransform):
                T = frames.lookup(self._frame, frame, header.stamp_ns)
                self._start = rigid.pose(*se3.to_pose(T))
                if frame == header.frame_id:
                    log.warning("%s", _TWO_PUBLISH.format(self._frame, frame))
                break
        return self._start

    def _shown(self) -> dict[str, Any]:
        """Diagnostics and markers: now and then, and at once if the state changed."""
        navigator = self._navigator
        if navigator is None:
            return {}
        for text in navigator.news():
            log.warning("landmark_navigator: %s", text)
        belief, outcome = navigator.belief, navigator.outcome
        news = belief.counts["images"] + navigator.dropped.total()
        if belief.stamp_ns is None or news == self._images:
            return {}
        self._images = news
        for text in self._rejections.look(outcome):
            log.warning("landmark_navigator: %s (further occurrences suppressed)", text)
        at = Header(belief.stamp_ns, self._frame)
        state = f"{belief.reason} {sorted(outcome.rejected)}"
        is_due = self._shown_ns is None or at.stamp_ns - self._shown_ns >= _SHOWN_NS
        if not is_due and state == self._state:
            return {}
        self._shown_ns, self._state = at.stamp_ns, state
        self._is_due = True
        return {"diagnostics": messages.diagnostics_of(navigator, self._now, at)}

    def _landmarks(self) -> dict[str, Any]:
        """Landmarks and markers, if due: after an image, whose own step is long enough."""
        navigator = self._navigator
        if not self._is_due or navigator is None or self._now is None:
            return {}
        self._is_due = False
        at = Header(self._now.stamp_ns, self._frame)
        landmarks, markers = self._messages.of(navigator, self._now, at)
        return {"landmarks": landmarks, "markers": markers}


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

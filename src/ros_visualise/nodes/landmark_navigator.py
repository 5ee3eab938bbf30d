"""The node that tells where the robot is in a map of landmarks."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ros_visualise.data import (
    Detections,
    Detections3D,
    DiagnosticArray,
    Header,
    MarkerArray,
    Odometry,
    PoseWithCovarianceStamped,
    Transforms,
    TransformStamped,
)
from ros_visualise.errors import NoTransform, OpenError
from ros_visualise.geometry import rigid, transforms
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.landmarks.localization import map_file
from ros_visualise.landmarks.localization.track import Track
from ros_visualise.landmarks.navigation import told
from ros_visualise.landmarks.navigation.chart import Mode, Rules
from ros_visualise.landmarks.navigation.landmark import Known
from ros_visualise.landmarks.navigation.motion import OdometryNoise
from ros_visualise.landmarks.navigation.navigator import Navigator, Now, Settings
from ros_visualise.landmarks.navigation.sights import view_of
from ros_visualise.nodes import action, node
from ros_visualise.nodes.landmark_localizer import names_in, write_map
from ros_visualise.params import param

log = logging.getLogger(__name__)

_MAP = "map"  # REP 105
_SHOWN_NS = 200_000_000  # between what people look at


@dataclass(frozen=True)
class NavigatorParams:
    """Parameters of `LandmarkNavigator`."""

    mode: Mode = param(
        Mode.BUILD,
        "the map: build a new one, extend the given one, or frozen: leave it as it is",
    )
    map: str = param("", "YAML file of landmarks, as save_map writes it", group="map")
    save_to: str = param(
        "landmarks.yaml", "YAML file that save_map writes the landmarks to", group="map"
    )
    class_prefix: str = param(
        "landmark_",
        "what to put before classes that are numbers, as on ROS 1, such as tag36h11_",
        group="map",
    )
    min_sightings: int = param(
        5,
        "sightings after which a new landmark corrects the robot",
        min=1,
        max=1000,
        slider=(1, 20),
        group="map",
    )
    min_parallax: float = param(
        0.1,
        "how far apart these are at least, as a part of the landmark's range",
        min=0,
        max=10,
        slider=(0, 1),
        group="map",
    )
    moving: str = param(
        "", "classes that are no landmarks, as they move, as in: pad, person", group="map"
    )
    corner_floor: float = param(
        0.1,
        "pixels that corners deviate at least (standard deviation); real cameras may need 0.3",
        min=0,
        max=10,
        slider=(0, 2),
        group="camera",
    )
    delay: float = param(
        0.5,
        "seconds that an image may be on its way, with all that is made of it",
        min=0.01,
        max=60,
        slider=(0.1, 2),
        group="camera",
    )
    odom_scale: float = param(
        0.01,
        "lasting error of all distances (standard deviation), as a fraction: 0.01 is 1%",
        min=0,
        max=1,
        slider=(0, 0.1),
        group="odometry",
    )
    odom_turn_scale: float = param(
        0.0,
        "lasting error of all turns (standard deviation), as a fraction; wheels have 0.02",
        min=0,
        max=1,
        slider=(0, 0.1),
        group="odometry",
    )
    odom_noise: float = param(
        0.02,
        "error of the position that grows with the distance (standard deviation), m/sqrt(m)",
        min=1e-5,
        max=10,
        slider=(0, 0.2),
        group="odometry",
    )
    odom_heading_noise: float = param(
        0.2,
        "error of the heading that grows with the distance (standard deviation), deg/sqrt(m)",
        min=1e-5,
        max=90,
        slider=(0, 5),
        group="odometry",
    )
    odom_tilt_noise: float = param(
        0.02,
        "error of roll and pitch that grows with the distance (standard deviation), deg/sqrt(m)",
        min=0,
        max=90,
        slider=(0, 5),
        group="odometry",
    )
    odom_still_noise: float = param(
        0.001,
        "error of the position that grows while it stands (standard deviation), m/sqrt(s)",
        min=0,
        max=10,
        slider=(0, 0.1),
        group="odometry",
    )
    level_sigma: float = param(
        0.5,
        "how level the odometry's frame is (standard deviation), degrees; 90: nobody knows",
        min=0.01,
        max=90,
        slider=(0.1, 10),
        group="odometry",
    )
    max_speed: float = param(
        30.0,
        "m/s; an odometry that is faster has jumped",
        min=0.1,
        max=1000,
        slider=(1, 50),
        group="odometry",
    )


@node(
    "landmark_navigator",
    params=NavigatorParams,
    inputs={"detections": Detections, "odometry": Odometry},
    outputs={
        "pose": PoseWithCovarianceStamped,
        "tf": Transforms,
        "landmarks": Detections3D,
        "markers": MarkerArray,
        "diagnostics": DiagnosticArray,
    },
    frames=True,
)
class LandmarkNavigator:
    """Corrects an odometry by landmarks: tells map -> odom, and the robot's pose in the map."""

    def __init__(self, params: NavigatorParams) -> None:
        self._begun = rigid.IDENTITY
        self._open(params)
        self.reset()

    def _open(self, params: NavigatorParams) -> None:
        self._params = params
        self._given: dict[str, Track] = {}
        self._frame = _MAP
        if params.mode is Mode.BUILD:
            return
        if not params.map:
            raise OpenError(f"mode {params.mode.value} needs a map: give its file as map")
        self._frame, several = map_file.load(Path(params.map))
        self._given = {one.name: one for one in several}

    def reset(self) -> None:
        """Begin anew: time jumped."""
        self._navigator: Navigator | None = None
        self._odom_frame = self._base_frame = ""
        self._now: Now | None = None
        self._told_ns: int | None = None
        self._said = ""

    @action("write the landmarks to the file save_to")
    def save_map(self) -> None:
        """Write the map; what was there is replaced when all of it is written."""
        tracks = told.tracks_of(self._navigator, self._given) if self._navigator else []
        if not tracks:
            log.warning("there is no landmark yet: nothing is written")
            return
        path = Path(self._params.save_to)
        write_map(path, self._frame, tracks)
        log.info("%d landmarks are in %s", len(tracks), path.absolute())

    def step(
        self,
        params: NavigatorParams,
        detections: Detections | None = None,
        odometry: Odometry | None = None,
        *,
        frames: FrameTree,
    ) -> dict[str, Any] | None:
        """The robot's pose for each odometry; the landmarks for images."""
        if params is not self._params:
            self._change(params)
        answer: dict[str, Any] = {}
        if odometry is not None:
            answer = self._go_on(odometry, frames)
        elif detections is not None and self._navigator is not None:
            T = frames.lookup(
                self._base_frame, detections.header.frame_id, detections.header.stamp_ns
            )
            moving = names_in(params.moving)
            view = view_of(detections, T, params.class_prefix, params.corner_floor, moving)
            self._navigator.see(view)
        return (answer | self._shown()) or None

    def _change(self, params: NavigatorParams) -> None:
        """Go on with other parameters; with another map, begin anew."""
        before, self._params = self._params, params
        if (params.mode, params.map) != (before.mode, before.map):
            self._open(params)
            self.reset()
        elif self._navigator is not None:
            self._navigator.settings = _settings(params)

    def report(self) -> dict[str, Any]:
        """How many images were used, and how often it was lost."""
        if self._navigator is None:
            return {}
        there = self._navigator.chart.landmarks.values()
        return {**self._navigator.counts, "landmarks": sum(one.is_used for one in there)}

    def _go_on(self, odometry: Odometry, frames: FrameTree) -> dict[str, Any]:
        header = odometry.header
        if self._navigator is None:
            self._odom_frame, self._base_frame = header.frame_id, odometry.child_frame_id
            start = self._start(frames, header)
            self._navigator = Navigator(_settings(self._params), _known(self._given), start)
        pose = rigid.pose(odometry.position_xyz, odometry.quat_xyzw)
        now = self._navigator.odometry(header.stamp_ns, pose)
        if now is None:
            return {}
        self._now = now
        place, quat = transforms.to_pose(now.T_map_odom)
        at = Header(header.stamp_ns, self._frame)
        answer: dict[str, Any] = {
            "tf": Transforms((TransformStamped(self._odom_frame, place, quat, at),))
        }
        if now.is_located:
            place, quat = transforms.to_pose(now.T_map_base)
            answer["pose"] = PoseWithCovarianceStamped(place, quat, now.covariance, at)
        return answer

    def _start(self, frames: FrameTree, header: Header) -> rigid.Pose:
        """T_map_odom where somebody tells where the odometry began, else they are one.

        Of odom a frame odom_start tells it, as those of simulated robots. What was told holds
        again after a jump of time.
        """
        for frame in (f"{header.frame_id}_start", header.frame_id):
            with suppress(NoTransform):
                T = frames.lookup(self._frame, frame, header.stamp_ns)
                self._begun = rigid.pose(*transforms.to_pose(T))
                break
        return self._begun

    def _shown(self) -> dict[str, Any]:
        """What people look at: now and then, and at once where something is new."""
        navigator = self._navigator
        if navigator is None or not navigator.has_news:
            return {}
        navigator.has_news = False
        at = Header(navigator.at_ns, self._frame)
        said = f"{navigator.trouble} {sorted(navigator.judged.refused)}"
        is_due = self._told_ns is None or at.stamp_ns - self._told_ns >= _SHOWN_NS
        if not is_due and said == self._said:
            return {}
        self._told_ns, self._said = at.stamp_ns, said
        answer: dict[str, Any] = {"diagnostics": told.diagnostics_of(navigator, self._now, at)}
        if self._now is not None:
            answer["landmarks"] = told.landmarks_of(navigator, at)
            answer["markers"] = told.markers_of(navigator, self._now, at)
        return answer


def _known(tracks: Mapping[str, Track]) -> dict[str, Known]:
    """The landmarks of a map that have an orientation."""
    return {
        name: Known.of(
            one.best.R_fixed_landmark,
            one.best.position_xyz,
            one.covariance,
            float(one.size_xyz[:2].mean()),
        )
        for name, one in tracks.items()
        if one.turned
    }


def _settings(p: NavigatorParams) -> Settings:
    noise = OdometryNoise(
        p.odom_scale,
        p.odom_turn_scale,
        p.odom_noise,
        math.radians(p.odom_heading_noise),
        math.radians(p.odom_tilt_noise),
        p.odom_still_noise,
    )
    rules = Rules(p.mode, p.min_sightings, p.min_parallax)
    return Settings(rules, noise, float(np.radians(p.level_sigma)), p.delay, p.max_speed)

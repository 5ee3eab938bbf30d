"""The node that maps landmarks."""

from __future__ import annotations

import copy
import logging
import math
from collections import deque
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ros_visualise.core.errors import NoTransform, OpenError, UsageError
from ros_visualise.core.params import param
from ros_visualise.core.printing import counted
from ros_visualise.data import (
    Detections,
    Detections3D,
    Floats,
    Header,
    MarkerArray,
    Odometry,
    Transforms,
)
from ros_visualise.estimation.localization import map_file
from ros_visualise.estimation.localization.localizer import Localizer, LocalizerRules
from ros_visualise.estimation.localization.messages import LandmarkMessages
from ros_visualise.estimation.localization.robot_error import ErrorModel, at_camera
from ros_visualise.estimation.localization.seen import Ground
from ros_visualise.estimation.localization.track import LandmarkTrack
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.landmarks.map_params import MapParams
from ros_visualise.nodes import action, node
from ros_visualise.sinks.files import save_again

log = logging.getLogger(__name__)

_MAP, _ODOM = "map", "odom"  # REP 105
_KEPT = 1000  # odometries that wait for the image of their time, which takes longer to process


@dataclass(frozen=True)
class LocalizerParams(MapParams):
    """Parameters of `LandmarkLocalizer`."""

    fixed_frame: str = param(
        _MAP, "frame of the landmarks; if no frame named map exists, odom is used instead"
    )
    min_sightings: int = param(
        3, "number of sightings before a landmark is accepted", min=1, max=1000, slider=(1, 20)
    )
    ground_frame: str = param(
        "", "frame whose x-y plane is the ground; empty: the fixed frame", group="ground"
    )
    attitude_sigma: float = param(
        1.0,
        "standard deviation of the robot's attitude, degrees, if odom has no covariance",
        min=0,
        max=45,
        slider=(0, 5),
        group="robot",
    )
    attitude_time: float = param(
        60.0,
        "time constant of the attitude error, seconds",
        min=0.01,
        max=1e9,
        slider=(1, 600),
        group="robot",
    )
    position_sigma: float = param(
        0.05,
        "standard deviation of the robot's position, metres, if odom has no covariance",
        min=0,
        max=1e3,
        slider=(0, 1),
        group="robot",
    )
    position_time: float = param(
        60.0,
        "time constant of the position error, seconds",
        min=0.01,
        max=1e9,
        slider=(1, 600),
        group="robot",
    )


@node(
    "landmark_localizer",
    params=LocalizerParams,
    inputs={"detections": Detections, "objects": Detections, "odom": Odometry},
    outputs={"landmarks": Detections3D, "markers": MarkerArray, "tf_static": Transforms},
    topics={"markers": "/landmark_markers", "tf_static": "/landmarks/tf_static"},
    latched=("landmarks", "markers", "tf_static"),
    frames=True,
    splittable=False,
)
class LandmarkLocalizer:
    """Maps landmarks in a fixed frame, from the tf tree and detections with poses.

    A landmark does not move, so its frame is one of ``tf_static``.
    """

    def __init__(self, params: LocalizerParams) -> None:
        self._params = params
        self._known: list[LandmarkTrack] = []
        if params.map:
            frame_id, self._known, _ = map_file.load(Path(params.map))
            if frame_id != params.fixed_frame:
                raise OpenError(
                    f"{params.map}: its landmarks are in the frame {frame_id};"
                    f" set fixed_frame={frame_id}"
                )
        self._frame = ""
        self._localizer, self._anew = Localizer(), True
        self.reset()

    def reset(self) -> None:
        """Start over with the landmarks of the map: time jumped."""
        self._start_over("time jumped")
        self._odometry: deque[Odometry] = deque(maxlen=_KEPT)

    @action("write the landmarks to the file that save_to names")
    def save_map(self, params: LocalizerParams) -> None:
        """Write the map; replace its former file when it is complete.

        It is in ``fixed_frame``, even where that is unknown and the landmarks are in ``odom``,
        which differs from run to run.
        """
        frame_id, tracks = self._params.fixed_frame, self._localizer.landmarks.values()
        save_landmarks(params.save_to, frame_id, tracks)

    def step(
        self,
        params: LocalizerParams,
        detections: Detections | None = None,
        objects: Detections | None = None,
        odom: Odometry | None = None,
        *,
        frames: FrameTree,
    ) -> dict[str, Any] | None:
        """All landmarks by now; ``objects`` are detections of a second detector."""
        self._params = params
        if odom is not None and odom.pose_covariance.any():
            self._odometry.append(odom)
        prefix = params.class_prefix if objects is None else params.object_prefix
        detections = objects if detections is None else detections
        if detections is None:
            return None
        header = detections.header
        T_fixed_camera = self._place(frames, header)
        robot = self._robot_covariance(frames, header.stamp_ns, T_fixed_camera[:3, 3])
        rules = rules_of(params, prefix, frames, self._frame, header.stamp_ns)
        self._localizer.observe(detections, T_fixed_camera, rules, robot)
        return self._answer(Header(header.stamp_ns, self._frame))

    def report(self) -> dict[str, Any]:
        """Numbers of sightings of each landmark, and of rejected detections by reason."""
        landmarks = self._localizer.landmarks.values()
        return {
            "landmarks": len(landmarks),
            "seen": {one.name: one.seen for one in landmarks},
            "skipped": dict(self._localizer.skipped),
        }

    def _answer(self, header: Header) -> dict[str, Any]:
        """All landmarks; markers and frames only if one of them changed."""
        landmarks = self._localizer.landmarks.values()
        answer: dict[str, Any] = {"landmarks": self._shown.detections(landmarks, header)}
        if self._anew or self._localizer.has_changed:
            answer["markers"] = self._shown.markers(landmarks, header)
            answer["tf_static"] = self._shown.transforms(landmarks, header)
        self._anew = False
        return answer

    def _place(self, frames: FrameTree, header: Header) -> Floats:
        """T_fixed_camera (4, 4) at the time of an image, in map or else odom."""
        fixed = self._params.fixed_frame
        if fixed == _MAP and not self._known and _MAP not in frames.frames():
            fixed = _ODOM
        T_fixed_camera = frames.lookup(fixed, header.frame_id, header.stamp_ns)
        if fixed != self._frame:
            if fixed != self._params.fixed_frame:
                log.warning("no frame %s; publishing landmarks in %s", _MAP, fixed)
            self._frame = fixed
            self._start_over(f"frame changed to {fixed}")
        return T_fixed_camera

    def _start_over(self, why: str) -> None:
        """Begin again with the landmarks of the map: the same views would count twice."""
        dropped = len(self._localizer.landmarks) - len(self._known)
        if dropped > 0:
            what = counted(dropped, "landmark")
            log.warning("%s: dropping %s; next time, call save_map first to keep them", why, what)
        self._localizer = Localizer(copy.deepcopy(self._known))
        self._shown, self._anew = LandmarkMessages(), True

    def _robot_covariance(self, frames: FrameTree, stamp_ns: int, camera: Floats) -> Floats | None:
        """Covariance (6, 6) of the camera's pose from odometry; None if unknown."""
        if not self._odometry:
            return None
        odom = min(self._odometry, key=lambda one: abs(stamp_ns - one.header.stamp_ns))
        try:
            T = frames.lookup(self._frame, odom.header.frame_id, stamp_ns)
        except NoTransform:
            return None
        base = T[:3, :3] @ odom.position_xyz + T[:3, 3]
        return at_camera(odom.pose_covariance, T[:3, :3], camera - base)


def save_landmarks(
    file: str, frame_id: str, tracks: Collection[LandmarkTrack], common: Floats | None = None
) -> None:
    """Save landmarks to a map, and log it; see `ros_visualise.estimation.localization.map_file`."""
    if not tracks:
        log.warning("no landmarks yet; nothing saved")
        return
    path = Path(file)
    check_map_name(path)
    save_again(path, map_file.to_text(frame_id, tracks, common).encode())
    log.info("%d landmarks saved to %s", len(tracks), path.absolute())


def check_map_name(path: Path) -> None:
    """Reject an invalid file name of a map.

    Raises:
        UsageError: it does not end in .yaml.
    """
    if path.suffix != ".yaml":
        raise UsageError(f"{path.name}: give a map a name that ends in .yaml")


def rules_of(
    p: LocalizerParams, prefix: str, frames: FrameTree, fixed_frame: str, stamp_ns: int
) -> LocalizerRules:
    """The rules for an image.

    Raises:
        NoTransform: the ground is unknown.
    """
    ground = None
    if p.ground:
        T = frames.lookup(fixed_frame, p.ground_frame or fixed_frame, stamp_ns)
        height = p.ground_height + float(T[:3, 2] @ T[:3, 3])
        ground = Ground(T[:3, 2], height, p.ground_sigma)
    attitude = math.radians(p.attitude_sigma)
    errors = ErrorModel(p.position_sigma, attitude, p.position_time, p.attitude_time)
    return LocalizerRules(p.min_sightings, errors, ground, prefix, p.moving_classes)

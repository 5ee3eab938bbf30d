"""The node that knows places again by what they look like."""

from __future__ import annotations

import logging
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ros_visualise.core.errors import OpenError
from ros_visualise.core.params import param
from ros_visualise.data import (
    CameraInfo,
    Detection,
    Detections,
    Floats,
    Hypothesis,
    Image,
    Odometry,
)
from ros_visualise.estimation.camera_view import PLACE
from ros_visualise.estimation.visual.place_file import (
    MOST_PLACES,
    MappedPlace,
    load_places,
    places_path,
    to_bytes,
)
from ros_visualise.estimation.visual.place_memory import PlaceMemory, PlaceSighting
from ros_visualise.geometry import rotations, se3
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.landmarks.once_log import OnceLog
from ros_visualise.nodes import action, node
from ros_visualise.nodes.landmark_localizer import check_map_name
from ros_visualise.sinks.files import save_again
from ros_visualise.vision import color
from ros_visualise.vision.threads import fit_threads

log = logging.getLogger(__name__)

_UNKNOWN = 1e3  # variance of the velocity above which an odometry says that it is lost
_LONGEST_NS = 1_000_000_000  # between messages of an odometry that goes on
_FASTEST = 50.0  # m/s: faster odometry has jumped
_MOST_WAITING = 30  # images, for the odometry
_KEPT = 1000  # messages of the odometry
_ONLY_NEW = "recognizing only new places"


@dataclass(frozen=True)
class PlaceParams:
    """Parameters of `PlaceRecognizer`."""

    rate: float = param(
        5.0, "maximum rate at which images are compared, Hz", min=0.1, max=60, slider=(0.5, 30)
    )
    places: int = param(
        500,
        "maximum number of new places to remember, besides those of the map",
        min=10,
        max=MOST_PLACES,
        slider=(10, 1000),
        restart=True,
    )
    map: str = param(
        "",
        "YAML file of a map whose places are recognized, as written by landmarks --places or"
        " save_map; its .places.npz file must be beside it",
        group="map",
        restart=True,
        file=bool,
    )
    save_to: str = param(
        "landmarks.yaml",
        "YAML file of the navigator's map; save_places writes the appearance of the places"
        " beside it",
        group="map",
        file=bool,
    )


class _OdometryPose(NamedTuple):
    stamp_ns: int
    T_odom_base: Floats
    goes_on: bool


@node(
    "place_recognizer",
    params=PlaceParams,
    inputs={"image": Image, "odometry": Odometry},
    outputs={"places": Detections},
    topics={"places": "/places"},
    calibrated=True,
    frames=True,
    splittable=False,
)
class PlaceRecognizer:
    """Detects places that the camera has seen before, as landmarks for the navigator.

    Each place is a landmark with a pose in the camera and its covariance. The odometry in metres
    gives places their size, and tells those apart that only look alike.
    """

    def __init__(self, params: PlaceParams) -> None:
        self._remarks = OnceLog("place_recognizer")
        self._open(params)

    def _open(self, params: PlaceParams) -> None:
        """Begin with the places of a map, or with none, as if it raises OpenError."""
        self._params = params
        self._known: list[MappedPlace] = []
        self.reset()
        if params.map:
            self._known = load_places(Path(params.map))
            if not self._known:
                log.warning("place_recognizer: %s has no places; %s", params.map, _ONLY_NEW)

    @action("write the appearance of the places to a file beside the map (save_to)")
    def save_places(self, params: PlaceParams) -> None:
        """Write the appearance of all places; their poses are in the navigator's map."""
        looks = [] if self._memory is None else self._memory.looks
        map_path = Path(params.save_to)
        check_map_name(map_path)
        if not looks:
            log.warning("no places yet; nothing saved")
            return
        save_again(places_path(map_path), to_bytes(looks))
        log.info("%d places saved to %s", len(looks), places_path(map_path).absolute())

    def reset(self) -> None:
        """Start over: time jumped."""
        self._memory: PlaceMemory | None = None
        self._info: CameraInfo | None = None
        self._poses: deque[_OdometryPose] = deque(maxlen=_KEPT)
        self._waiting: deque[Image] = deque(maxlen=_MOST_WAITING)
        self._base, self._looked_ns, self._reached_ns = "", -1, -1

    def step(
        self,
        params: PlaceParams,
        image: Image | None = None,
        odometry: Odometry | None = None,
        *,
        frames: FrameTree,
    ) -> dict[str, Any] | None:
        """The places in the oldest image that the odometry has reached; one image a step."""
        if (params.places, params.map) != (self._params.places, self._params.map):
            try:
                self._open(params)
            except OpenError as error:
                log.warning("place_recognizer: %s; until then %s", error, _ONLY_NEW)
        self._params = params
        if image is not None:
            self._wait(image)
        if odometry is not None:
            self._go_on(odometry)
        while self._waiting and self._poses and self._is_reached(self._waiting[0]):
            if answer := self._see(self._waiting.popleft(), frames):
                return answer
        return None

    def report(self) -> dict[str, Any]:
        """Numbers of views and places."""
        return {} if self._memory is None else dict(self._memory.counts)

    def _wait(self, image: Image) -> None:
        """Keep an image until its odometry has come, if it is time for one."""
        stamp_ns = image.header.stamp_ns
        if image.camera_info is None:
            self._remarks.say("no places: the camera is not calibrated")
        elif self._looked_ns < 0 or stamp_ns - self._looked_ns >= 0.98e9 / self._params.rate:
            self._looked_ns = stamp_ns
            self._waiting.append(image)

    def _go_on(self, odometry: Odometry) -> None:
        T = se3.from_pose(odometry.position_xyz, odometry.quat_xyzw)
        stamp_ns, self._base = odometry.header.stamp_ns, odometry.child_frame_id
        known = odometry.twist_covariance[0, 0] < _UNKNOWN and bool(np.isfinite(T).all())
        if self._poses:
            last = self._poses[-1]
            gone_ns = stamp_ns - last.stamp_ns
            if gone_ns <= 0:
                return
            far = float(np.linalg.norm(T[:3, 3] - last.T_odom_base[:3, 3]))
            known &= gone_ns <= _LONGEST_NS and far < max(_FASTEST * gone_ns / 1e9, 0.5)
        self._poses.append(_OdometryPose(stamp_ns, T, known))

    def _is_reached(self, image: Image) -> bool:
        return self._poses[-1].stamp_ns >= image.header.stamp_ns

    def _see(self, image: Image, frames: FrameTree) -> dict[str, Any] | None:
        T_odom_base = self._pose_at(image.header.stamp_ns)
        info = image.camera_info
        if T_odom_base is None or info is None:
            return None
        fit_threads(image.pixels)
        gray = color.gray_of(image)
        header = image.header
        T = T_odom_base @ frames.lookup(self._base, header.frame_id, header.stamp_ns)
        if self._memory is None:
            self._memory = PlaceMemory(info, self._params.places, self._known)
        found = self._memory.look(header.stamp_ns, gray, T)
        size = image.width, image.height
        return {"places": Detections(tuple(map(_detection, found)), header, info, size)}

    def _pose_at(self, stamp_ns: int) -> Floats | None:
        """T_odom_base at an image, interpolated; None while the odometry is lost."""
        poses = list(self._poses)
        after = int(np.searchsorted([one.stamp_ns for one in poses], stamp_ns))
        since = [one for one in poses[: after + 1] if one.stamp_ns > self._reached_ns]
        end = poses[after]
        self._reached_ns = end.stamp_ns
        if not all(one.goes_on for one in since) and self._memory is not None:
            self._memory.interrupt()
        start = poses[max(after - 1, 0)]
        if not end.goes_on or (after == 0 and end.stamp_ns != stamp_ns):
            return None
        if end.stamp_ns == start.stamp_ns or end.stamp_ns == stamp_ns:
            return end.T_odom_base
        part = (stamp_ns - start.stamp_ns) / (end.stamp_ns - start.stamp_ns)
        return se3.interpolate(start.T_odom_base, end.T_odom_base, part)


def _detection(one: PlaceSighting) -> Detection:
    """A sighting as a detection without pixels, whose pose is in the camera's axes."""
    quat = rotations.from_matrix(one.R)
    hypothesis = Hypothesis(f"{PLACE}{one.id}", 1.0, one.t, quat, one.covariance, one.id)
    return Detection(np.full(2, np.nan), np.full(2, np.nan), 0.0, (hypothesis,), str(one.id))

"""The detections in each image, gathered while a graph runs, and as JSON."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import Detection, Detections, Detections3D, Hypothesis, Image
from ros_visualise.graph import Graph
from ros_visualise.graph.landmarks import LOCALIZER, detectors_of
from ros_visualise.messages.recorded import content
from ros_visualise.runtime.queues import Packet

_NO_RANGE = 1e5  # m^2: with so large a variance, a position is only a direction


@dataclass(eq=False)
class ImageDetections:
    """One image, or recorded detections of one: its time, its size, and all detections in it."""

    stamp_ns: int
    size: tuple[int, int] | None = None
    found: list[tuple[str, Detection]] = field(default_factory=list)
    """(frame, detection)."""

    @property
    def names(self) -> set[str]:
        """The detected classes."""
        return {one.class_id for _, one in self.found}


class DetectionLog:
    """Gathers the images and the detections of a graph, and the landmarks made of them."""

    def __init__(self, graph: Graph) -> None:
        detectors = detectors_of(graph)
        taken = [topic for node in detectors for topic in node.inputs.values()]
        found = [topic for node in detectors for topic in node.topics_of(Detections)]
        maps = graph.topics_of(Detections3D, LOCALIZER)
        self._takers: dict[str, Callable[[int, Any], None]] = {
            **dict.fromkeys(found, self._add_found),
            **dict.fromkeys(taken, self._add_image),
            **dict.fromkeys(maps[:1], self._keep_map),
        }
        self._by_number: dict[int, ImageDetections] = {}
        self._lock = threading.Lock()
        self.map: Detections3D | None = None

    @property
    def listeners(self) -> Mapping[str, MessageListener]:
        """Topic -> its listener."""
        return {topic: MessageListener(take) for topic, take in self._takers.items()}

    @property
    def images(self) -> list[ImageDetections]:
        """All images, in their order."""
        with self._lock:
            return [self._by_number[number] for number in sorted(self._by_number)]

    @property
    def seen(self) -> Counter[str]:
        """Name -> number of images in which it was detected."""
        return Counter(name for image in self.images for name in sorted(image.names))

    def _add_image(self, number: int, message: Image | Detections) -> None:
        if isinstance(message, Image):
            size: tuple[int, int] | None = (message.width, message.height)
        else:
            info = message.camera_info
            size = None if info is None else (info.width, info.height)
        with self._lock:
            self._at(number, message).size = size

    def _add_found(self, number: int, message: Detections) -> None:
        frame = message.header.frame_id
        with self._lock:
            self._at(number, message).found += [(frame, one) for one in message.detections]

    def _keep_map(self, _: int, message: Detections3D) -> None:
        self.map = message

    def _at(self, number: int, message: Image | Detections) -> ImageDetections:
        return self._by_number.setdefault(number, ImageDetections(message.header.stamp_ns))


class MessageListener:
    """Passes the messages of a topic on, with their numbers; nodes report damaged ones."""

    def __init__(self, take: Callable[[int, Any], None]) -> None:
        self._take = take

    def put(self, packet: Packet) -> None:
        """Take a packet."""
        if packet.message is None:
            return
        try:
            self._take(packet.number, content(packet.message))
        except DamagedMessage:
            return

    def close(self) -> None:
        """Note the end of the stream."""


def image_json(image: ImageDetections, path: str | None) -> dict[str, Any]:
    """All detections in one image."""
    width, height = image.size or (None, None)
    return {
        "path": path,
        "stamp": image.stamp_ns / 1e9,
        "width": width,
        "height": height,
        "detections": [_detection(frame, one) for frame, one in image.found],
    }


def landmarks_json(log: DetectionLog, sighted: Mapping[str, int]) -> list[dict[str, Any]]:
    """Each landmark once: those of the map with their poses, then the others.

    Args:
        log: all detections.
        sighted: number of sightings of each landmark of the map, by name.
    """
    seen = log.seen
    placed = [] if log.map is None else list(log.map.detections)
    found = [
        {
            "name": one.id or one.class_id,
            "frame_id": log.map.header.frame_id,  # type: ignore[union-attr]
            "pose": pose_json(one.hypotheses[0]) if one.hypotheses else None,
            "seen": sighted.get(one.id, seen.get(one.class_id, 0)),
        }
        for one in placed
    ]
    mapped = {one.class_id for one in placed}
    frames = {one.class_id: frame for image in log.images for frame, one in image.found}
    for name in sorted(seen.keys() - mapped):
        found.append({"name": name, "frame_id": frames[name], "pose": None, "seen": seen[name]})
    return found


def _detection(frame_id: str, one: Detection) -> dict[str, Any]:
    best = one.class_id
    poses = [pose for h in one.hypotheses if h.class_id == best and (pose := pose_json(h))]
    return {
        "name": best,
        "id": int(one.id) if one.id.isdecimal() else None,
        "score": one.score,
        "box": _box(one),
        "corners": one.corners_uv.tolist() if len(one.corners_uv) else None,
        "point": _finite(one.center_uv if one.point_uv is None else one.point_uv),
        "frame_id": frame_id,
        "pose": poses[0] if poses else None,
        "other_pose": poses[1] if len(poses) > 1 else None,
    }


def _box(one: Detection) -> list[float] | None:
    """The upright box around it: x, y, width, height."""
    low, high = one.outline_uv.min(axis=0), one.outline_uv.max(axis=0)
    return _finite(np.concatenate([low, high - low]))


def _finite(values: Any) -> list[float] | None:
    """A list for JSON, which has no NaN."""
    return values.tolist() if np.isfinite(values).all() else None


def pose_json(one: Hypothesis) -> dict[str, Any] | None:
    """A hypothesis's pose; None if unknown, or a direction only."""
    known = one.covariance.any() or one.position_xyz.any()
    if not known or np.linalg.eigvalsh(one.covariance[:3, :3])[-1] >= _NO_RANGE:
        return None
    return {
        "position": one.position_xyz.tolist(),
        "orientation": one.quat_xyzw.tolist(),
        "covariance": one.covariance.ravel().tolist(),
    }

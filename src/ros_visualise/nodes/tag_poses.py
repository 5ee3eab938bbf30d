"""The node that estimates the poses of tags from recorded corners."""

from __future__ import annotations

from dataclasses import replace

from ros_visualise.data import Detection, Detections
from ros_visualise.landmarks.once_log import OnceLog
from ros_visualise.landmarks.pose import CornerErrors
from ros_visualise.landmarks.tags import Tag
from ros_visualise.landmarks.tags.known import KnownTags, parse_ids, read_known_tags
from ros_visualise.landmarks.tags.locating import locate_or_remark
from ros_visualise.landmarks.tags.pose_params import PoseParams
from ros_visualise.landmarks.tags.shutter import RollingShutter
from ros_visualise.nodes import node


@node(
    "tag_poses",
    params=PoseParams,
    inputs={"corners": Detections},
    outputs={"detections": Detections},
)
class TagPoses:
    """Adds poses to recorded tags, from their corners and the camera's calibration."""

    def __init__(self, params: PoseParams) -> None:
        self._remarks = OnceLog("tag_poses")
        self._shutter = RollingShutter()
        self._path = ""
        self._known = KnownTags()
        self._floor = params.corner_floor
        self._errors = CornerErrors(self._floor)
        self._read(params)

    def step(self, corners: Detections, params: PoseParams) -> Detections:
        """The same tags with their poses, then what is no tag as it came."""
        self._read(params)
        every = [tag for one in corners.detections if (tag := _tag(one)) is not None]
        tags = self._known.present(every, corners.header.stamp_ns, parse_ids(params.ignore))
        rest = tuple(one for one in corners.detections if _tag(one) is None)
        info = corners.camera_info
        if info is None and tags:
            self._remarks.say("no poses: the tags come without a camera calibration")
        if info:
            stamp_ns = corners.header.stamp_ns
            tags = self._shutter.at_stamp(tags, stamp_ns, info.height, params.readout)
        found = locate_or_remark(
            tags, self._known, params.size, info, params.camera, self._errors, self._remarks
        )
        return replace(corners, detections=found + rest)

    def _read(self, params: PoseParams) -> None:
        if params.corner_floor != self._floor:
            self._floor, self._errors = params.corner_floor, CornerErrors(params.corner_floor)
        if params.tags != self._path:
            self._known = read_known_tags(params.tags) if params.tags else KnownTags()
            self._path = params.tags


def _tag(found: Detection) -> Tag | None:
    """A detection as a tag; None of what has no corners, or no number."""
    family, _, number = found.class_id.rpartition("_")
    if len(found.corners_uv) != 4 or not number.isdecimal():
        return None
    hamming = round(1 / found.score) - 1 if found.score > 0 else 0
    return Tag(family, int(number), found.corners_uv, hamming, 0.0)

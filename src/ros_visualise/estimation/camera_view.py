"""Landmark sightings in an image, as the filter needs them: corners, poses or directions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterable
from dataclasses import dataclass

import numpy as np

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.data import Detection, Detections, Floats, Hypothesis
from ros_visualise.geometry import rotations
from ros_visualise.landmarks.localization.seen import UNKNOWN
from ros_visualise.landmarks.pose.corner_noise import corner_noise
from ros_visualise.landmarks.pose.rays import Rays, rays_of

_CORNERS = 4  # of a tag


@dataclass(frozen=True, eq=False)
class ObservedPose:
    """One reading of a landmark: its pose in the camera's frame, with covariance.

    ``covariance`` (6, 6) is of the position and of a rotation about the camera's axes. ``R`` is
    None without an orientation; without ``has_range``, ``t`` is only a direction.
    """

    R: Floats | None
    t: Floats
    covariance: Floats
    score: float
    has_range: bool


@dataclass(frozen=True, eq=False)
class Sighting:
    """One landmark in one image.

    Attributes:
        name: its class; that of a tag is unique.
        number: of the class, see `ros_visualise.data.Hypothesis`.
        side_m: side of a tag; 0 if unknown.
        rays: of its four corners; None if unknown.
        noise_px2: (8, 8) covariance of their coordinates.
        poses: its possible readings, the likeliest first.
    """

    name: str
    number: int
    side_m: float
    rays: Rays | None
    noise_px2: Floats
    poses: tuple[ObservedPose, ...]

    @property
    def has_corners(self) -> bool:
        """True if its corners can be compared with their expected pixels."""
        return self.rays is not None and self.side_m > 0

    @property
    def has_orientation(self) -> bool:
        """True if it has an orientation, as tags do; then its class is unique."""
        return self.has_corners or any(pose.R is not None for pose in self.poses)


@dataclass(frozen=True, eq=False)
class CameraView:
    """One image: its time, the camera's pose on the robot, and the landmarks in it.

    Attributes:
        R_base_camera, p_base_camera: (3, 3) and (3,).
        sights: the usable sightings.
        skipped: names of the others, with the reason.
        print: fingerprint of all corners and poses; equal ones mean the same image.
        camera: its number, see `ros_visualise.estimation.measuring.CAMERAS`.
    """

    stamp_ns: int
    R_base_camera: Floats
    p_base_camera: Floats
    sights: tuple[Sighting, ...]
    skipped: dict[str, str]
    print: bytes
    camera: int = 0


def view_of(
    detections: Detections,
    T_base_camera: Floats,
    prefix: str = "",
    floor_px: float = 0.0,
    moving: Container[str] = (),
    camera: int = 0,
) -> CameraView:
    """The view given by detections.

    Args:
        detections: with poses in the camera's optical frame.
        T_base_camera: (4, 4) the camera's pose on the robot at the time of the image.
        prefix: put before classes that are numbers.
        floor_px: smallest standard deviation of corners.
        moving: classes that are not landmarks.
        camera: its number.
    """
    sights, skipped = [], {}
    found = [one for one in detections.detections if one.hypotheses]
    rays = _rays(found, detections)
    for number, one in enumerate(found):
        sight = _sight(one, rays.get(number), prefix, floor_px)
        if sight.name in moving:
            skipped[sight.name] = "moves"
        elif sight.poses or sight.has_corners:
            sights.append(sight)
        else:
            skipped[sight.name] = "no pose"
    often = Counter(sight.name for sight in sights if sight.has_orientation)
    skipped |= {name: "duplicate in the image" for name, count in often.items() if count > 1}
    kept = tuple(sight for sight in sights if sight.name not in skipped)
    R, p = T_base_camera[:3, :3], T_base_camera[:3, 3]
    return CameraView(detections.header.stamp_ns, R, p, kept, skipped, _print(found), camera)


def _rays(found: list[Detection], detections: Detections) -> dict[int, Rays]:
    """The rays of tags' corners, by index in the list."""
    info = detections.camera_info
    tags = [n for n, one in enumerate(found) if len(one.corners_uv) == _CORNERS and one.side_m > 0]
    if info is None or not tags:
        return {}
    try:
        directions, to_pixels = rays_of([found[n].corners_uv for n in tags], info)
    except RosVisualiseError:
        return {}
    several = zip(tags, directions, to_pixels, strict=True)
    return {n: Rays(d, px) for n, d, px in several if np.isfinite(d).all()}


def _sight(one: Detection, rays: Rays | None, prefix: str, floor_px: float) -> Sighting:
    first = one.hypotheses[0]
    name = prefix + first.class_id if first.class_id.isdigit() else first.class_id
    several = (_pose(h) for h in one.hypotheses if h.class_id == first.class_id)
    poses = tuple(pose for pose in several if pose is not None)
    return Sighting(name, first.number, one.side_m, rays, _noise(one, floor_px), poses)


def _noise(one: Detection, floor_px: float) -> Floats:
    """(8, 8) covariance of its corners; from the tag's size if its detector gives none."""
    if len(one.corners_uv) != _CORNERS:
        return np.zeros((8, 8))
    known = one.corners_covariance if one.corners_covariance.any() else np.full((8, 8), np.nan)
    noise: Floats = corner_noise(one.corners_uv[None], floor_px, known[None])[0]
    return noise


def _pose(hypothesis: Hypothesis) -> ObservedPose | None:
    """One reading; None without a pose."""
    t, covariance = hypothesis.position_xyz, hypothesis.covariance
    range_m = float(np.linalg.norm(t))
    if not (0 < range_m < np.inf and np.isfinite(covariance).all() and np.isfinite(t).all()):
        return None
    values = np.linalg.eigvalsh(covariance)
    if (np.diag(covariance) <= 0).any() or values[0] < -1e-9 * values[-1]:
        return None
    ray = t / range_m
    has_range = bool(ray @ covariance[:3, :3] @ ray < UNKNOWN)
    has_orientation = has_range and bool(np.trace(covariance[3:, 3:]) < UNKNOWN)
    R = rotations.to_matrix(hypothesis.quat_xyzw) if has_orientation else None
    return ObservedPose(R, t, covariance, hypothesis.score, has_range)


def _print(found: Iterable[Detection]) -> bytes:
    parts = (
        part
        for one in found
        for part in (one.corners_uv, *(h.position_xyz for h in one.hypotheses))
    )
    return b"".join(part.tobytes() for part in parts)

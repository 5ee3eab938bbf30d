"""What an image shows of landmarks, as the filter takes it: corners, poses or directions."""

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
    """One reading of a landmark: its pose in the camera's frame, and the covariance of that.

    ``covariance`` (6, 6) is that of the position and of a turn about the camera's axes. Where
    ``R`` is None it has no orientation; without ``has_range``, ``t`` tells a direction alone.
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
        name: its class; that of a tag is of one landmark alone.
        number: of the class, as `ros_visualise.data.Hypothesis` has it.
        side_m: of a tag's square; 0 where nobody knows.
        rays: of its four corners; None where nobody knows.
        noise_px2: (8, 8) covariance of their coordinates.
        poses: what its picture may be, the likeliest first.
    """

    name: str
    number: int
    side_m: float
    rays: Rays | None
    noise_px2: Floats
    poses: tuple[ObservedPose, ...]

    @property
    def has_corners(self) -> bool:
        """Whether its corners can be compared with where they are expected."""
        return self.rays is not None and self.side_m > 0

    @property
    def is_turned(self) -> bool:
        """Whether it tells how it is turned: then it is the only one of its class."""
        return self.has_corners or any(pose.R is not None for pose in self.poses)


@dataclass(frozen=True, eq=False)
class CameraView:
    """One image: when it was taken, where its camera is on the robot, and what is in it.

    Attributes:
        R_base_camera, p_base_camera: (3, 3) and (3,).
        sights: of landmarks, each that can be used.
        left_out: names of those that cannot, and why.
        print: of all corners and poses; two images with the same are one image.
    """

    stamp_ns: int
    R_base_camera: Floats
    p_base_camera: Floats
    sights: tuple[Sighting, ...]
    left_out: dict[str, str]
    print: bytes


def view_of(
    detections: Detections,
    T_base_camera: Floats,
    prefix: str = "",
    floor_px: float = 0.0,
    moving: Container[str] = (),
) -> CameraView:
    """What detections tell.

    Args:
        detections: their poses are in the camera's optical frame.
        T_base_camera: (4, 4) where that is on the robot, at the time of the image.
        prefix: what to put before classes that are numbers.
        floor_px: standard deviation that corners have at least.
        moving: classes that are no landmarks.
    """
    sights, left_out = [], {}
    found = [one for one in detections.detections if one.hypotheses]
    rays = _rays(found, detections)
    for number, one in enumerate(found):
        sight = _sight(one, rays.get(number), prefix, floor_px)
        if sight.name in moving:
            left_out[sight.name] = "moves"
        elif sight.poses or sight.has_corners:
            sights.append(sight)
        else:
            left_out[sight.name] = "no pose"
    often = Counter(sight.name for sight in sights if sight.is_turned)
    left_out |= {name: "twice in an image" for name, count in often.items() if count > 1}
    kept = tuple(sight for sight in sights if sight.name not in left_out)
    R, p = T_base_camera[:3, :3], T_base_camera[:3, 3]
    return CameraView(detections.header.stamp_ns, R, p, kept, left_out, _print(found))


def _rays(found: list[Detection], detections: Detections) -> dict[int, Rays]:
    """The rays of tags' corners, by their places in the list."""
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
    """(8, 8) covariance of its corners; by the tag's size where its detector does not tell."""
    if len(one.corners_uv) != _CORNERS:
        return np.zeros((8, 8))
    known = one.corners_covariance if one.corners_covariance.any() else np.full((8, 8), np.nan)
    noise: Floats = corner_noise(one.corners_uv[None], floor_px, known[None])[0]
    return noise


def _pose(hypothesis: Hypothesis) -> ObservedPose | None:
    """One reading; None of what has no pose."""
    t, covariance = hypothesis.position_xyz, hypothesis.covariance
    range_m = float(np.linalg.norm(t))
    if not (0 < range_m < np.inf and np.isfinite(covariance).all() and np.isfinite(t).all()):
        return None
    values = np.linalg.eigvalsh(covariance)
    if (np.diag(covariance) <= 0).any() or values[0] < -1e-9 * values[-1]:
        return None
    ray = t / range_m
    has_range = bool(ray @ covariance[:3, :3] @ ray < UNKNOWN)
    is_turned = has_range and bool(np.trace(covariance[3:, 3:]) < UNKNOWN)
    R = rotations.to_matrix(hypothesis.quat_xyzw) if is_turned else None
    return ObservedPose(R, t, covariance, hypothesis.score, has_range)


def _print(found: Iterable[Detection]) -> bytes:
    parts = (
        part
        for one in found
        for part in (one.corners_uv, *(h.position_xyz for h in one.hypotheses))
    )
    return b"".join(part.tobytes() for part in parts)

"""Landmark sightings in an image, as the filter needs them: corners, poses or directions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterable
from dataclasses import dataclass, field

import numpy as np

from ros_visualise.core.errors import NoTransform, RosVisualiseError
from ros_visualise.data import Detection, Detections, Floats, Header, Hypothesis
from ros_visualise.estimation.localization.seen import UNKNOWN
from ros_visualise.geometry import rotations, se3
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.landmarks.pose.corner_noise import corner_noise
from ros_visualise.landmarks.pose.rays import Rays, rays_of

PLACE = "place_"
"""First part of the names of places, see `ros_visualise.estimation.visual.place_memory`."""

_CORNERS = 4  # of a tag
_TURNED_NS = 20_000_000  # over which the turning of a camera on the robot is measured
_AGE_S = 0.02  # standard deviation of the age of a gimbal's angles
_NO_NOISE = np.zeros((8, 8))


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
    def is_place(self) -> bool:
        """True if it is a view of the camera's own: exact when seen first."""
        return self.name.startswith(PLACE)

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
        turning: (3,) angular velocity of the camera on the robot, rad/s in its own axes.
        moving: sightings of things that move, which are not landmarks.
    """

    stamp_ns: int
    R_base_camera: Floats
    p_base_camera: Floats
    sights: tuple[Sighting, ...]
    skipped: dict[str, str]
    print: bytes
    camera: int = 0
    turning: Floats = field(default_factory=lambda: np.zeros(3))
    moving: tuple[Sighting, ...] = ()

    @property
    def turn_variance(self) -> float:
        """Variance of the camera's attitude about each axis, rad^2, anew in each image.

        The angles of a gimbal are a little old: while it turns, they err by its turn since.
        """
        return _AGE_S**2 * float(self.turning @ self.turning)


def turning_of(frames: FrameTree, base: str, header: Header, T_base_camera: Floats) -> Floats:
    """(3,) angular velocity of a camera on the robot, rad/s in its own axes, as on a gimbal.

    Args:
        frames: with the camera's frame.
        base: frame of the robot.
        header: of the image.
        T_base_camera: (4, 4) at the image.
    """
    try:
        before = frames.lookup(base, header.frame_id, header.stamp_ns - _TURNED_NS)
    except NoTransform:  # the first of the moving transforms
        return np.zeros(3)
    turned = se3.rotation_vector(before[:3, :3].T @ T_base_camera[:3, :3])
    return turned / (_TURNED_NS / 1e9)


def view_of(
    detections: Detections,
    T_base_camera: Floats,
    prefix: str = "",
    floor_px: float = 0.0,
    moving: Container[str] = (),
    camera: int = 0,
    turning: Floats | None = None,
) -> CameraView:
    """The view given by detections.

    Args:
        detections: with poses in the camera's optical frame.
        T_base_camera: (4, 4) the camera's pose on the robot at the time of the image.
        prefix: put before classes that are numbers.
        floor_px: smallest standard deviation of corners.
        moving: classes that are not landmarks.
        camera: its number.
        turning: see `CameraView`; None: it is fixed.
    """
    sights, moved, skipped = [], [], {}
    found = [one for one in detections.detections if one.hypotheses]
    rays, noise, poses = _rays(found, detections), _noise(found, floor_px), _poses(found)
    for number, one in enumerate(found):
        sight = _sighting_of(
            one, rays.get(number), noise.get(number, _NO_NOISE), poses[number], prefix
        )
        if sight.name in moving:
            skipped[sight.name] = "moves"
            moved.append(sight)
        elif sight.poses or sight.has_corners:
            sights.append(sight)
        else:
            skipped[sight.name] = "no pose"
    often = Counter(sight.name for sight in sights if sight.has_orientation)
    skipped |= {name: "duplicate in the image" for name, count in often.items() if count > 1}
    kept = tuple(sight for sight in sights if sight.name not in skipped)
    R, p = T_base_camera[:3, :3], T_base_camera[:3, 3]
    rates = np.zeros(3) if turning is None else turning
    image = _print(found), camera, rates, tuple(moved)
    return CameraView(detections.header.stamp_ns, R, p, kept, skipped, *image)


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


def _sighting_of(
    one: Detection, rays: Rays | None, noise: Floats, poses: tuple[ObservedPose, ...], prefix: str
) -> Sighting:
    first = one.hypotheses[0]
    name = prefix + first.class_id if first.class_id.isdigit() else first.class_id
    return Sighting(name, first.number, one.side_m, rays, noise, poses)


def _noise(found: list[Detection], floor_px: float) -> dict[int, Floats]:
    """(8, 8) covariances of tags' corners, by index in the list.

    They come from the size of a tag if its detector gives none.
    """
    tags = [n for n, one in enumerate(found) if len(one.corners_uv) == _CORNERS]
    if not tags:
        return {}
    known = [found[n].corners_covariance for n in tags]
    known = [one if one.any() else np.full((8, 8), np.nan) for one in known]
    corners = np.array([found[n].corners_uv for n in tags])
    return dict(zip(tags, corner_noise(corners, floor_px, np.array(known)), strict=True))


def _poses(found: list[Detection]) -> list[tuple[ObservedPose, ...]]:
    """The readings of each detection."""
    several = [
        [h for h in one.hypotheses if h.class_id == one.hypotheses[0].class_id] for one in found
    ]
    read = iter(_read([h for hypotheses in several for h in hypotheses]))
    each = [[next(read) for _ in hypotheses] for hypotheses in several]
    return [tuple(pose for pose in poses if pose is not None) for poses in each]


def _read(several: list[Hypothesis]) -> list[ObservedPose | None]:
    """The readings given by hypotheses; None without a pose."""
    t = np.array([one.position_xyz for one in several]).reshape(-1, 3)
    covariance = np.array([one.covariance for one in several]).reshape(-1, 6, 6)
    is_finite = np.isfinite(t).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2))
    ranges = np.where(is_finite, np.linalg.norm(t, axis=1), 0.0)
    is_pose = (ranges > 0) & (ranges < np.inf)
    safe = np.where(is_pose[:, None, None], covariance, np.eye(6))
    values = np.linalg.eigvalsh(safe)
    is_pose &= (np.diagonal(safe, axis1=1, axis2=2) > 0).all(axis=1)
    is_pose &= values[:, 0] >= -1e-9 * values[:, -1]
    rays = np.where(is_pose[:, None], t, 1.0) / np.where(is_pose, ranges, 1.0)[:, None]
    along = (rays[:, None] @ safe[:, :3, :3] @ rays[..., None])[:, 0, 0]
    has_range = along < UNKNOWN
    turned = is_pose & has_range & (np.trace(safe[:, 3:, 3:], axis1=1, axis2=2) < UNKNOWN)
    places = np.flatnonzero(turned)
    quats = np.array([several[n].quat_xyzw for n in places]).reshape(-1, 4)
    R = dict(zip(places.tolist(), rotations.to_matrix(quats), strict=True))
    return [
        ObservedPose(R.get(n), t[n], covariance[n], one.score, bool(has_range[n]))
        if is_pose[n]
        else None
        for n, one in enumerate(several)
    ]


def _print(found: Iterable[Detection]) -> bytes:
    parts = (
        part
        for one in found
        for part in (one.corners_uv, *(h.position_xyz for h in one.hypotheses))
    )
    return b"".join(part.tobytes() for part in parts)

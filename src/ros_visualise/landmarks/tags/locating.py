"""From tags in an image to detections with names and poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ros_visualise.core.errors import UncalibratedCamera, UnsupportedImage
from ros_visualise.data import CameraInfo, Detection, Floats, Hypothesis
from ros_visualise.landmarks.once_log import OnceLog
from ros_visualise.landmarks.pose import (
    EXACT,
    CameraError,
    CornerErrors,
    PoseEstimate,
    rig_poses,
    squares_poses,
)
from ros_visualise.landmarks.tags.finder import Tag
from ros_visualise.landmarks.tags.known import Bundle, KnownTags


def locate(
    tags: Sequence[Tag],
    known: KnownTags,
    size_m: float,
    info: CameraInfo | None,
    camera: CameraError = EXACT,
    errors: CornerErrors | None = None,
) -> tuple[Detection, ...]:
    """Detections of tags, then of bundles, each with its possible poses.

    If two poses fit the corners, they are two hypotheses of one class, the likelier first. Tags of
    a bundle that are not standalone too are part of its detection, whose number is that of its
    first tag. Without a calibration there are no poses and no bundles: each tag is a detection.

    Args:
        tags: of one image.
        known: their sizes, and bundles.
        size_m: side of all others; 0 if unknown: no poses.
        info: the camera's calibration.
        camera: errors of the camera and its calibration.
        errors: of this camera, from its earlier images; None: from this image alone.
    """
    errors = errors or CornerErrors(camera.floor_px)
    bundles = known.bundles if info else ()
    members = {id for bundle in bundles for id in bundle.corners_xyz}
    alone = [tag for tag in tags if tag.id not in members or tag.id in known.sizes]
    sizes = [known.sizes.get(tag.id, size_m) for tag in alone]
    poses = _poses(alone, sizes, info, camera, errors)
    several = zip(alone, sizes, poses, strict=True)
    extra = errors.variance_px2
    found = [_of_tag(tag, known, size, one, extra) for tag, size, one in several]
    if info:
        for bundle in bundles:
            found += _of_bundle(tags, bundle, info, camera, errors)
    return tuple(found)


def locate_or_remark(
    tags: Sequence[Tag],
    known: KnownTags,
    size_m: float,
    info: CameraInfo | None,
    camera: CameraError,
    errors: CornerErrors,
    remarks: OnceLog,
) -> tuple[Detection, ...]:
    """`locate`, with a warning if the calibration or a missing size prevents poses."""
    unsized = {tag.name for tag in tags if tag.id not in known.every}
    if info and not size_m and unsized:
        names = ", ".join(sorted(unsized))
        text = f"no poses for tags of unknown size ({names}): set size, or give a file of tags"
        remarks.say(text, "unknown size")
    try:
        return locate(tags, known, size_m, info, camera, errors)
    except (UncalibratedCamera, UnsupportedImage) as error:
        remarks.say(f"no poses: {error}")
        return locate(tags, known, size_m, None, camera, errors)


def _poses(
    tags: Sequence[Tag],
    sizes: Sequence[float],
    info: CameraInfo | None,
    camera: CameraError,
    errors: CornerErrors,
) -> list[tuple[PoseEstimate, ...]]:
    found: list[tuple[PoseEstimate, ...]] = [()] * len(tags)
    sized = [number for number, size in enumerate(sizes) if size > 0]
    if info and sized:
        corners = np.array([tags[number].corners_uv for number in sized])
        of_known = [sizes[number] for number in sized]
        noise = _noise([tags[number] for number in sized])
        estimates = squares_poses(corners, of_known, info, None, camera, noise, errors)
        for number, one in zip(sized, estimates, strict=True):
            found[number] = one
    return found


def _noise(tags: Sequence[Tag]) -> Floats:
    """(T, 8, 8) covariances of their corners; NaN if unknown."""
    unknown = np.full((8, 8), np.nan)
    return np.array([unknown if tag.covariance_px2 is None else tag.covariance_px2 for tag in tags])


def _of_tag(
    tag: Tag, known: KnownTags, size_m: float, poses: Sequence[PoseEstimate], extra_px2: float
) -> Detection:
    name = known.names.get(tag.id, tag.name)
    hypotheses = _hypotheses(name, _score(tag), tag.id, poses)
    found = Detection.of_corners(tag.corners_uv, hypotheses, str(tag.id))
    known_px2 = tag.covariance_px2
    noise = np.zeros((8, 8)) if known_px2 is None else known_px2 + extra_px2 * np.eye(8)
    return replace(found, point_uv=tag.center_uv, side_m=size_m, corners_covariance=noise)


def _of_bundle(
    tags: Sequence[Tag],
    bundle: Bundle,
    info: CameraInfo,
    camera: CameraError,
    errors: CornerErrors,
) -> list[Detection]:
    """One detection from all visible tags of a bundle; none if no tag is visible."""
    seen = [tag for tag in tags if tag.id in bundle.corners_xyz]
    if not seen:
        return []
    corners = np.array([tag.corners_uv for tag in seen])
    points = np.concatenate([bundle.corners_xyz[tag.id] for tag in seen])
    flat = corners.reshape(-1, 2)
    poses = rig_poses(flat, points, info, None, camera, _noise(seen), errors)
    score, first = max(map(_score, seen)), next(iter(bundle.corners_xyz))
    box = Detection.of_corners(flat, _hypotheses(bundle.name, score, first, poses), bundle.name)
    return [replace(box, corners_uv=np.zeros((0, 2)))]  # without an outline


def _hypotheses(
    name: str, score: float, number: int, poses: Sequence[PoseEstimate]
) -> tuple[Hypothesis, ...]:
    if not poses:
        return (Hypothesis(name, score, number=number),)
    return tuple(
        Hypothesis(
            name, score * one.probability, one.position_xyz, one.quat_xyzw, one.covariance, number
        )
        for one in poses
    )


def _score(tag: Tag) -> float:
    """The fewer wrong cells, the higher; as for recorded tags."""
    return 1 / (1 + tag.hamming)

"""Landmarks with known direction only: points on the ground, such as the foot of a post.

Several may have the same class, so a sighting is matched only if it fits a single landmark.

Source: Y. Bar-Shalom, T. Fortmann, Tracking and Data Association, 1988 (gates, and the rejection of
ambiguous matches).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.camera_view import CameraView, Sighting
from ros_visualise.estimation.gates import GATES, Innovation
from ros_visualise.estimation.landmark import Landmark
from ros_visualise.estimation.measuring import CameraPose, Pair, camera_of
from ros_visualise.estimation.robot import POSE
from ros_visualise.estimation.state import State
from ros_visualise.estimation.updating import fits, stand_on
from ros_visualise.geometry.se3 import cross

_FLAT = 0.09  # sine of the smallest angle between a ray and the ground
_VAGUE = 0.5  # initial standard deviation along the ray, as a fraction of the range
_NEAR = 0.2  # rad; largest angle to a known point
_CLOSE = 25.0  # times the gate within which a sighting starts no new landmark


class GroundPlane(NamedTuple):
    """The ground in the map: height, its standard deviation, and its roughness, metres."""

    height_m: float
    sigma_m: float
    roughness_m: float = 0.05


def is_in_view(p: Floats, kind: str, view: CameraView, camera: CameraPose) -> bool:
    """True if a point (3,) of a class may be among the sightings."""
    away = camera.R.T @ (p - camera.p)
    cosines = [
        away @ pose.t / (np.linalg.norm(away) * np.linalg.norm(pose.t) + 1e-12)
        for sight in view.sights
        if sight.name == kind
        for pose in sight.poses[:1]
    ]
    return any(one > np.cos(_NEAR) for one in cosines)


class PointMatch(NamedTuple):
    """A sighting and its landmark: None for a new one, or if ambiguous (with the reason)."""

    sight: Sighting
    landmark: Landmark | None
    why: str = ""


def match(
    state: State, view: CameraView, sights: Sequence[Sighting], landmarks: Sequence[Landmark]
) -> list[PointMatch]:
    """Match points: each landmark at most once, and only unambiguous ones."""
    found = [_closest(state, view, sight, landmarks) for sight in sights]
    names = [one.landmark.name for one in found if one.landmark]
    return [
        one._replace(landmark=None, why="two sightings match one landmark")
        if one.landmark and names.count(one.landmark.name) > 1
        else one
        for one in found
    ]


def begin(
    state: State, view: CameraView, sight: Sighting, name: str, plane: GroundPlane
) -> tuple[State, Landmark] | None:
    """Add a new point to a state; None if its ray does not meet the ground."""
    camera = camera_of(view, state.robot)
    seen = sight.poses[0]
    ray = camera.R @ seen.t / np.linalg.norm(seen.t)
    above = camera.p[2] - plane.height_m
    if above <= 0 or -ray[2] < _FLAT:
        return None
    range_m = above / -ray[2]
    p = camera.p + range_m * ray
    state = state.copy()
    state.add(name, np.eye(3), p, _spread(camera, seen.covariance, seen.t, ray, range_m))
    state.share(state.rows(name), np.vstack([by_robot(p), np.zeros((3, 6))]), POSE)
    state = stand_on(state, name, plane.height_m, plane.roughness_m)
    return state, Landmark.first(sight, name, [name], [0.0], view, camera.p)


def by_robot(p: Floats) -> Floats:
    """(3, 6) effect of the robot's twist on a point that is carried with it."""
    return np.hstack([np.eye(3), -cross(p)])


def _closest(
    state: State, view: CameraView, sight: Sighting, landmarks: Sequence[Landmark]
) -> PointMatch:
    several = [one for one in landmarks if one.kind == sight.name]
    compared = fits(view, [Pair(sight, one.key) for one in several], state)
    ranked = sorted(zip(compared, several, strict=True), key=lambda one: one[0].distance2)
    inside = [one for fit, one in ranked if fit.is_inlier]
    if len(inside) > 1:
        return PointMatch(sight, None, f"ambiguous: {inside[0].name} or {inside[1].name}")
    if inside:
        return PointMatch(sight, inside[0])
    if ranked and _is_close(ranked[0][0]):
        return PointMatch(sight, None, f"too far from {ranked[0][1].name}")
    return PointMatch(sight, None)


def _is_close(fit: Innovation) -> bool:
    return fit.distance2 < _CLOSE * GATES[fit.size]


def _spread(camera: CameraPose, seen: Floats, t: Floats, ray: Floats, range_m: float) -> Floats:
    """(6, 6) covariance between camera and point given a direction; none of the rotation."""
    across = np.eye(3) - np.multiply.outer(ray, ray)
    lateral = across @ camera.R @ seen[:3, :3] @ camera.R.T @ across
    spread = np.zeros((6, 6))
    spread[:3, :3] = lateral * (range_m**2 / float(t @ t))
    spread[:3, :3] += (_VAGUE * range_m) ** 2 * np.multiply.outer(ray, ray)
    return spread

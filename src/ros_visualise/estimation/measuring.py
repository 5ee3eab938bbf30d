"""Expected measurements of landmarks in an image, and their derivatives by errors of a state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.camera_view import CameraView, ObservedPose, Sighting
from ros_visualise.estimation.robot import RobotState, own_states
from ros_visualise.estimation.state import State
from ros_visualise.geometry import se3
from ros_visualise.geometry.se3 import cross, turn_between
from ros_visualise.landmarks.pose.estimating import SQUARE

_CURVED = 4.0  # second-order errors, which last, count as so many times their white part
_NEAR = 1e-3  # least depth of a corner, as a fraction of its distance

CAMERAS = tuple(own_states(f"camera {number}", 5) for number in (1, 2))
"""Errors of each camera: of its clock, s (positive: images are stamped too early); of its attitude
(3,), rad about its own axes; of its focal length, as a fraction.
"""
CLOCK, TURN, FOCAL = 0, slice(1, 4), 4


def turn_of(camera: int) -> slice:
    """Rows of the error of a camera's attitude."""
    start = CAMERAS[camera].rows.start
    return slice(start + TURN.start, start + TURN.stop)


class Pair(NamedTuple):
    """A sighting, and the key of its landmark in the state."""

    sight: Sighting
    key: str


@dataclass(frozen=True, eq=False)
class LinearizedPair:
    """One pair, of k numbers, to first order.

    Attributes:
        residual: (k,) measured minus expected; NaN behind the camera.
        of_landmark, of_robot: (k, 6) derivatives of the expected by their twists.
        of_camera: (k, 5) derivative by the errors of the camera.
        noise: (k, k) covariance.
    """

    residual: Floats
    of_landmark: Floats
    of_robot: Floats
    of_camera: Floats
    noise: Floats


class CameraPose(NamedTuple):
    """Pose of the camera in the map: (3, 3) and (3,).

    ``by_camera`` (6, 4) is the twist of that pose by the errors of its clock and attitude.
    """

    R: Floats
    p: Floats
    by_camera: Floats


def camera_of(view: CameraView, robot: RobotState) -> CameraPose:
    """The camera of a robot, when the image was taken."""
    own = robot[CAMERAS[view.camera]]
    late_s = float(own[CLOCK])
    R_base, p_base = robot.R, robot.p
    if late_s:
        R_base = se3.exp(np.concatenate([np.zeros(3), late_s * robot.rates]))[0] @ R_base
        p_base = p_base + late_s * robot.v
    R = R_base @ view.R_base_camera
    if own[TURN].any():
        R = R @ se3.exp(np.concatenate([np.zeros(3), own[TURN]]))[0]
    p = R_base @ view.p_base_camera + p_base
    by_camera = np.empty((6, 4))
    by_camera[:3, 0] = robot.v + cross(p_base) @ robot.rates
    by_camera[3:, 0] = robot.rates
    by_camera[:3, 1:], by_camera[3:, 1:] = cross(p) @ R, R
    return CameraPose(R, p, by_camera)


def measure(view: CameraView, pairs: Sequence[Pair], state: State) -> list[LinearizedPair]:
    """Each pair linearized at the state's estimates."""
    camera = camera_of(view, state.robot)
    focal = float(state.robot[CAMERAS[view.camera]][FOCAL])
    by_corners = [n for n, pair in enumerate(pairs) if pair.sight.has_corners]
    corners = _corners(camera, focal, [pairs[n] for n in by_corners], state)
    found = dict(zip(by_corners, corners, strict=True))
    for n, pair in enumerate(pairs):
        if n not in found:
            found[n] = _best_pose(camera, pair, state)
    return [found[n] for n in range(len(pairs))]


def _corners(
    camera: CameraPose, focal: float, pairs: Sequence[Pair], state: State
) -> list[LinearizedPair]:
    """Eight numbers each, in pixels; all tags at once."""
    if not pairs:
        return []
    places = state.indices([pair.key for pair in pairs])
    sights = [pair.sight for pair in pairs]
    points = SQUARE * np.array([sight.side_m for sight in sights])[:, None, None]
    R, p = state.landmarks_R[places], state.landmarks_p[places]
    at = points @ np.swapaxes(R, -1, -2) + p[:, None]
    rays = [sight.rays for sight in sights if sight.rays is not None]
    directions = np.array([one.directions for one in rays])
    to_pixels = np.array([one.to_pixels for one in rays])
    seen = (at - camera.p) @ camera.R
    depth = (directions * seen).sum(axis=-1)
    hidden = depth < _NEAR * np.linalg.norm(seen, axis=-1)
    depth = np.where(hidden, 1.0, depth)
    offset = (to_pixels @ seen[..., None])[..., 0] / depth[..., None]
    by_point = to_pixels - offset[..., None] * directions[..., None, :]
    by_point = by_point / depth[..., None, None] @ camera.R.T
    by_turn = -by_point @ cross(at)
    H = np.concatenate([by_point, by_turn], axis=-1).reshape(len(pairs), 8, 6)
    from_middle = -to_pixels[..., 2] * directions[..., 2:]
    residual = np.where(hidden[..., None], np.nan, -offset - focal * from_middle)
    residual, by_focal = residual.reshape(-1, 8), from_middle.reshape(-1, 8)
    return [
        _pair(residual[n], H[n], camera, sight.noise_px2, by_focal[n])
        for n, sight in enumerate(sights)
    ]


def _pair(
    residual: Floats, H: Floats, camera: CameraPose, noise: Floats, by_focal: Floats | float = 0.0
) -> LinearizedPair:
    """A pair with the derivative (k, 6) of its expected values by the landmark's twist."""
    return _pair_of(residual, H, -H, camera, noise, by_focal)


def _pair_of(
    residual: Floats,
    of_landmark: Floats,
    of_robot: Floats,
    camera: CameraPose,
    noise: Floats,
    by_focal: Floats | float = 0.0,
) -> LinearizedPair:
    of_camera = np.empty((len(residual), 5))
    of_camera[:, :FOCAL], of_camera[:, FOCAL] = of_robot @ camera.by_camera, by_focal
    return LinearizedPair(residual, of_landmark, of_robot, of_camera, noise)


def _best_pose(camera: CameraPose, pair: Pair, state: State) -> LinearizedPair:
    """The reading that fits best by its own covariance."""
    (place,) = state.indices([pair.key])
    R, p, first = state.landmarks_R[place], state.landmarks_p[place], state.first_p[place]
    several = [_pose(camera, pose, R, p, first) for pose in pair.sight.poses]
    if not pair.sight.has_orientation:
        several = [_widened(one, state, pair, p - camera.p) for one in several]
    return min(several, key=lambda one: one.residual @ np.linalg.solve(one.noise, one.residual))


def _widened(one: LinearizedPair, state: State, pair: Pair, away: Floats) -> LinearizedPair:
    """A pair of a point, with the second-order error of its linearization as noise."""
    rows = state.rows(pair.key).start + np.arange(3)
    at = state.landmarks_p[state.keys.index(pair.key)]
    J = np.hstack([np.eye(3), -np.eye(3), cross(at)])
    columns = np.concatenate([rows, np.arange(6)])
    spread = J @ state.P[np.ix_(columns, columns)] @ J.T
    scale = 1.0 if len(one.residual) == 2 else float(away @ away)
    second = (_CURVED * float(np.trace(spread)) / float(away @ away)) ** 2 * scale
    return replace(one, noise=one.noise + second * np.eye(len(one.residual)))


def _pose(
    camera: CameraPose, pose: ObservedPose, R: Floats, p: Floats, first: Floats
) -> LinearizedPair:
    """Six numbers for a pose, three for a position, or two for a direction."""
    back = camera.R.T
    away = back @ (p - camera.p)
    if pose.R is not None:
        turn = turn_between(pose.R, back @ R)
        H = np.zeros((6, 6))
        H[:3, :3] = H[3:, 3:] = back
        H[:3, 3:] = -back @ cross(p)
        return _pair(np.concatenate([pose.t - away, turn]), H, camera, pose.covariance)
    # without rotation: a position, by the Jacobian at the first estimate
    of_landmark, of_robot = np.zeros((3, 6)), np.zeros((3, 6))
    of_landmark[:, :3], of_robot[:, :3], of_robot[:, 3:] = back, -back, back @ cross(first)
    noise, residual = pose.covariance[:3, :3], pose.t - away
    if pose.has_range:
        return _pair_of(residual, of_landmark, of_robot, camera, noise)
    first_away = back @ (first - camera.p)
    return _direction(camera, pose, away, first_away, of_landmark, of_robot)


def _direction(
    camera: CameraPose,
    pose: ObservedPose,
    away: Floats,
    first_away: Floats,
    of_landmark: Floats,
    of_robot: Floats,
) -> LinearizedPair:
    """Two numbers: the offset across the expected direction, as a fraction of its range.

    The Jacobians use the first estimate. With the present measurement they would be correlated with
    its noise; with what was learnt since, they would wrongly contain information on the scale.
    """
    range_m = float(np.linalg.norm(first_away))
    ahead, ray = first_away / range_m, pose.t / np.linalg.norm(pose.t)
    across = np.linalg.svd(ahead[None])[2][1:]
    aside = across - np.multiply.outer(across @ ray, ray)
    noise = aside @ pose.covariance[:3, :3] @ aside.T / float(pose.t @ pose.t)
    seen, expected = (one / max(float(ahead @ one), 1e-6) for one in (ray, away))
    residual = across @ (seen - expected)
    project = across / range_m
    return _pair_of(residual, project @ of_landmark, project @ of_robot, camera, noise)

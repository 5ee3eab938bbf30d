"""Expected measurements of landmarks in an image, and their derivatives by errors of a state."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.camera_view import CameraView, ObservedPose, Sighting
from ros_visualise.estimation.resting import PER_LANDMARK, TWIST, Indices
from ros_visualise.estimation.robot import RobotState, own_states
from ros_visualise.estimation.state import State
from ros_visualise.geometry.se3 import cross, turn_between
from ros_visualise.landmarks.pose.estimating import SQUARE

_CURVED = 4.0  # second-order errors, which last, count as so many times their white part
_EYE = np.eye(3)
_NEAR = 1e-3  # least depth of a corner, as a fraction of its distance

CAMERAS = tuple(own_states(f"camera {number}", 5) for number in (1, 2))
"""Errors of each camera: of its clock, s (positive: images are stamped too early); of its attitude
(3,), rad about its own axes; of its focal length, as a fraction.
"""
CLOCK, TURN, FOCAL = 0, slice(1, 4), 4


def clock_of(camera: int) -> slice:
    """The row of the error of a camera's clock."""
    start = CAMERAS[camera].rows.start + CLOCK
    return slice(start, start + 1)


def turn_of(camera: int) -> slice:
    """Rows of the error of a camera's attitude."""
    start = CAMERAS[camera].rows.start
    return slice(start + TURN.start, start + TURN.stop)


class Pair(NamedTuple):
    """A sighting, and the key of its landmark in the state."""

    sight: Sighting
    key: str


class LinearizedPairs(NamedTuple):
    """G pairs of k numbers each, to first order.

    Attributes:
        places: (G,) their places among all pairs of the image.
        residual: (G, k) measured minus expected; NaN behind the camera.
        of_shared: (G, k, 11) derivatives of the expected by the twist of the robot, and by the
            errors of the camera.
        of_landmark: (G, k, 7) derivatives by the errors of the landmarks.
        noise: (G, k, k) covariances.
    """

    places: Indices
    residual: Floats
    of_shared: Floats
    of_landmark: Floats
    noise: Floats


class CameraPose(NamedTuple):
    """Pose of the camera in the map: (3, 3) and (3,).

    ``by_camera`` (6, 4) is the twist of that pose by the errors of its clock and attitude.
    """

    R: Floats
    p: Floats
    by_camera: Floats


@lru_cache(4)  # neither changes, and an image is compared several times
def camera_of(view: CameraView, robot: RobotState) -> CameraPose:
    """The camera of a robot, when the image was taken."""
    own = robot[CAMERAS[view.camera]]
    late_s = float(own[CLOCK])
    R_base, p_base = robot.R, robot.p
    if late_s:
        R_base = cv2.Rodrigues(late_s * robot.rates)[0] @ R_base
        p_base = p_base + late_s * robot.v
    R = R_base @ view.R_base_camera
    if late_s and view.turning.any():  # a gimbal keeps it level while the body turns
        R = R @ cv2.Rodrigues(late_s * view.turning)[0]
    if own[TURN].any():
        R = R @ cv2.Rodrigues(own[TURN])[0]
    p = R_base @ view.p_base_camera + p_base
    by_camera = np.empty((6, 4))
    mount = R @ view.turning
    by_camera[:3, 0] = robot.v + cross(p_base) @ robot.rates + cross(p) @ mount
    by_camera[3:, 0] = robot.rates + mount
    by_camera[:3, 1:], by_camera[3:, 1:] = cross(p) @ R, R
    return CameraPose(R, p, by_camera)


def measure(view: CameraView, pairs: Sequence[Pair], state: State) -> list[LinearizedPairs]:
    """The pairs linearized at the state's estimates, those of equal size together."""
    camera = camera_of(view, state.robot)
    several: dict[int, list[LinearizedPairs]] = {}
    for n, pair in enumerate(pairs):
        if not pair.sight.has_corners:
            one = _best_pose(camera, pair, state)
            several.setdefault(one.residual.shape[1], []).append(one._replace(places=np.array([n])))
    found = [
        LinearizedPairs(*map(np.concatenate, zip(*ones, strict=True))) for ones in several.values()
    ]
    if by_corners := [n for n, pair in enumerate(pairs) if pair.sight.has_corners]:
        focal = float(state.robot[CAMERAS[view.camera]][FOCAL])
        corners = _corners(camera, focal, [pairs[n] for n in by_corners], state)
        found.append(corners._replace(places=np.array(by_corners)))
    return found


def _corners(
    camera: CameraPose, focal: float, pairs: Sequence[Pair], state: State
) -> LinearizedPairs:
    """Eight numbers each, in pixels."""
    places = state.indices([pair.key for pair in pairs])
    sights = [pair.sight for pair in pairs]
    sides_m = np.array([sight.side_m for sight in sights]) * np.exp(state.landmarks.sizes[places])
    points = SQUARE * sides_m[:, None, None]
    R, p = state.landmarks_R[places], state.landmarks_p[places]
    arms = points @ np.swapaxes(R, -1, -2)
    at = arms + p[:, None]
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
    H = np.concatenate([by_point, by_turn], axis=-1).reshape(len(pairs), 8, TWIST)
    by_size = (by_point @ arms[..., None]).reshape(len(pairs), 8)
    from_middle = -to_pixels[..., 2] * directions[..., 2:]
    residual = np.where(hidden[..., None], np.nan, -offset - focal * from_middle)
    residual, by_focal = residual.reshape(-1, 8), from_middle.reshape(-1, 8)
    noise = np.array([sight.noise_px2 for sight in sights])
    return _pairs(residual, H, -H, camera, noise, by_focal, by_size)


def _pairs(
    residual: Floats,
    of_landmark: Floats,
    of_robot: Floats,
    camera: CameraPose,
    noise: Floats,
    by_focal: Floats | float = 0.0,
    by_size: Floats | float = 0.0,
) -> LinearizedPairs:
    """Pairs with the derivatives (G, k, 6) of their expected values by both twists."""
    of_all = np.empty((*residual.shape, PER_LANDMARK))
    of_all[..., :TWIST], of_all[..., TWIST] = of_landmark, by_size
    of_shared = np.empty((*residual.shape, 11))
    of_shared[..., :6], of_shared[..., 6 + FOCAL] = of_robot, by_focal
    of_shared[..., 6 : 6 + FOCAL] = of_robot @ camera.by_camera
    return LinearizedPairs(np.arange(len(residual)), residual, of_shared, of_all, noise)


def _pair(
    residual: Floats,
    of_landmark: Floats,
    of_robot: Floats,
    camera: CameraPose,
    noise: Floats,
    by_size: Floats | float = 0.0,
) -> LinearizedPairs:
    """One pair."""
    one = residual[None], of_landmark[None], of_robot[None]
    return _pairs(*one, camera, noise[None], by_size=by_size)


def _best_pose(camera: CameraPose, pair: Pair, state: State) -> LinearizedPairs:
    """The reading that fits best by its own covariance."""
    (place,) = state.indices([pair.key])
    R, p, first = state.landmarks_R[place], state.landmarks_p[place], state.first_p[place]
    smaller = math.exp(-state.landmarks.sizes[place])
    several = [_pose(camera, pose, R, p, first, smaller) for pose in pair.sight.poses]
    if not pair.sight.has_orientation:
        several = [_widened(one, state, pair, p - camera.p) for one in several]
    return min(several, key=_distance2)


def _distance2(one: LinearizedPairs) -> float:
    (residual,) = one.residual
    return float(residual @ np.linalg.solve(one.noise[0], residual))


def _widened(one: LinearizedPairs, state: State, pair: Pair, away: Floats) -> LinearizedPairs:
    """A pair of a point, with the second-order error of its linearization as noise."""
    rows = state.rows(pair.key).start + np.arange(3)
    at = state.landmarks_p[state.keys.index(pair.key)]
    J = np.hstack([np.eye(3), -np.eye(3), cross(at)])
    columns = np.concatenate([rows, np.arange(6)])
    spread = J @ state.P[np.ix_(columns, columns)] @ J.T
    size = one.residual.shape[1]
    scale = 1.0 if size == 2 else float(away @ away)
    second = (_CURVED * float(np.trace(spread)) / float(away @ away)) ** 2 * scale
    return one._replace(noise=one.noise + second * np.eye(size))


def _pose(
    camera: CameraPose, pose: ObservedPose, R: Floats, p: Floats, first: Floats, smaller: float
) -> LinearizedPairs:
    """Six numbers for a pose, three for a position, or two for a direction.

    ``smaller`` is the stated size of a tag by the true one: it is seen as much nearer.
    """
    back = camera.R.T
    away = back @ (p - camera.p)
    if pose.R is not None:
        turn = turn_between(pose.R, back @ R)
        H = np.zeros((6, 6))
        H[3:, 3:] = back
        H[:3] = smaller * back @ np.hstack([_EYE, -cross(p)])
        residual = np.concatenate([pose.t - smaller * away, turn])
        by_size = np.concatenate([-smaller * away, np.zeros(3)])
        return _pair(residual, H, -H, camera, pose.covariance, by_size)
    # without rotation: a position, by the Jacobian at the first estimate
    of_landmark, of_robot = np.zeros((3, 6)), np.zeros((3, 6))
    of_landmark[:, :3], of_robot[:, :3], of_robot[:, 3:] = back, -back, back @ cross(first)
    noise, residual = pose.covariance[:3, :3], pose.t - away
    if pose.has_range:
        return _pair(residual, of_landmark, of_robot, camera, noise)
    first_away = back @ (first - camera.p)
    return _direction(camera, pose, away, first_away, of_landmark, of_robot)


def _direction(
    camera: CameraPose,
    pose: ObservedPose,
    away: Floats,
    first_away: Floats,
    of_landmark: Floats,
    of_robot: Floats,
) -> LinearizedPairs:
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
    return _pair(residual, project @ of_landmark, project @ of_robot, camera, noise)

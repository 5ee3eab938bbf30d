"""Bundle adjustment of tags, as a reference: the corners of all images in one least-squares sum."""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.sparse import lil_matrix

from ros_visualise.data import CameraInfo, Floats
from ros_visualise.geometry.transforms import from_pose, inverse
from ros_visualise.landmarks.pose import PoseEstimate

_SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) / 2
_SIGMA_PX = 0.3
_SCALES = (300, 30, 3, 1)  # of the robust loss: from the start, which is far, to the end


def adjust(
    images: Sequence[Mapping[int, Floats]],
    views: Sequence[Mapping[int, tuple[PoseEstimate, ...]]],
    sizes: Mapping[int, float],
    info: CameraInfo,
) -> dict[int, Floats]:
    """Positions (3,) of tags that are seen together with others, in frames of their own groups.

    Args:
        images: the corners (4, 2) of the tags in each.
        views: their poses, from which it starts.
        sizes: of the tags, metres.
        info: the camera's calibration.
    """
    seen = [(k, n) for k, view in enumerate(views) if len(view) > 1 for n in view]
    T_tags, T_cameras = _start(seen, views)
    tags, cameras = list(T_tags), list(T_cameras)
    of_tag = np.array([tags.index(n) for _, n in seen])
    of_camera = np.array([cameras.index(k) for k, _ in seen])
    corners = np.array([images[k][n] for k, n in seen])
    points = np.array([_SQUARE * sizes[n] for _, n in seen])
    start = np.array([*T_tags.values(), *T_cameras.values()])
    count, members = len(tags), (of_tag, of_camera + len(tags))

    def residuals(state: Floats) -> Floats:
        R, t = _moved(start, state)
        at = np.einsum("nij,ncj->nci", R[members[0]], points) + t[members[0], None]
        local = np.einsum("nji,ncj->nci", R[members[1]], at - t[members[1], None])
        pixels = cv2.projectPoints(local.reshape(-1, 3), np.zeros(3), np.zeros(3), info.K, info.D)
        return (pixels[0].reshape(-1, 4, 2) - corners).ravel() / _SIGMA_PX

    state = np.zeros(6 * len(start))
    sparsity = _sparsity(len(seen), len(start), members)
    for scale in _SCALES:
        options: dict[str, Any] = {"loss": "soft_l1", "f_scale": scale, "max_nfev": 30}
        found = least_squares(residuals, state, jac_sparsity=sparsity, x_scale="jac", **options)
        state = found.x
    places = _moved(start, state)[1]
    return {n: places[number] for number, n in enumerate(tags[:count])}


def _start(
    seen: Sequence[tuple[int, int]], views: Any
) -> tuple[dict[int, Floats], dict[int, Floats]]:
    """T_group_tag and T_group_camera, from one to the next by the surest poses."""
    links: dict[Any, list[tuple[float, int, int]]] = defaultdict(list)
    for image, tag in seen:
        doubt = float(np.trace(views[image][tag][0].covariance)) / views[image][tag][0].probability
        links["image", image].append((doubt, image, tag))
        links["tag", tag].append((doubt, image, tag))
    T_tags: dict[int, Floats] = {}
    T_cameras: dict[int, Floats] = {}
    for first in dict.fromkeys(tag for _, tag in seen):
        if first in T_tags:
            continue
        T_tags[first] = np.eye(4)
        waiting = list(links["tag", first])
        heapq.heapify(waiting)
        while waiting:
            _, image, tag = heapq.heappop(waiting)
            pose = views[image][tag][0]
            T_camera_tag = from_pose(pose.position_xyz, pose.quat_xyzw)
            if image not in T_cameras:
                T_cameras[image] = T_tags[tag] @ inverse(T_camera_tag)
                new = links["image", image]
            elif tag not in T_tags:
                T_tags[tag] = T_cameras[image] @ T_camera_tag
                new = links["tag", tag]
            else:
                continue
            for link in new:
                heapq.heappush(waiting, link)
    return T_tags, T_cameras


def _moved(start: Floats, state: Floats) -> tuple[Floats, Floats]:
    """Rotations (N, 3, 3) and positions (N, 3), away from where they start."""
    steps = state.reshape(-1, 6)
    turns = np.array([cv2.Rodrigues(step[3:])[0] for step in steps])
    return turns @ start[:, :3, :3], start[:, :3, 3] + steps[:, :3]


def _sparsity(count: int, bodies: int, members: tuple[Floats, Floats]) -> Any:
    pattern = lil_matrix((8 * count, 6 * bodies), dtype=int)
    for several in members:
        for number, body in enumerate(several):
            pattern[8 * number : 8 * number + 8, 6 * body : 6 * body + 6] = 1
    return pattern

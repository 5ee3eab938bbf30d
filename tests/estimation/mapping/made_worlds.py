"""Worlds of tags of which all is known, as a camera on a robot sees them."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np

from ros_visualise.data import CameraInfo, Hypothesis
from ros_visualise.estimation.mapping.problem import CameraPath, Problem, TagSighting
from ros_visualise.geometry import rotations
from ros_visualise.geometry.se3 import from_parts, inverse
from ros_visualise.landmarks.pose import squares_poses

SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) / 2
K = np.array([[600.0, 0, 320], [0, 600, 240], [0, 0, 1]])
INFO = CameraInfo(480, 640, K=K, D=np.zeros(5))
SIZE = 0.3


def turn(vector):
    """(3, 3) of a rotation vector."""
    return cv2.Rodrigues(np.asarray(vector, float))[0]


def floor(random, count, width=6.0):
    """T_map_tag (count, 4, 4) of tags on an uneven floor, the first at the origin."""
    tags = []
    for number in range(count):
        at = [width * number / count, random.uniform(-1, 1), random.uniform(-0.3, 0.3)]
        R = turn(0.2 * random.standard_normal(3)) @ turn([0, 0, random.uniform(-3, 3)])
        tags.append(from_parts(R, at))
    return np.array(tags)


def flight(random, views, width=6.0, height=3.0):
    """T_map_camera (views, 4, 4) along the floor, looking down, turning as it goes."""
    cameras = []
    for number in range(views):
        share = number / max(views - 1, 1)
        at = [width * share - 0.3, 0.5 * np.sin(6 * share), height + 0.4 * np.sin(9 * share)]
        down = np.diag([1.0, -1, -1])
        tilt = turn(0.15 * random.standard_normal(3))
        cameras.append(from_parts(turn([0, 0, 2 * np.sin(5 * share)]) @ tilt @ down, at))
    return np.array(cameras)


def corners_seen(T_map_camera, T_map_tag, size=SIZE):
    """(4, 2) pixels, None where not all of the tag is in the image."""
    T = inverse(T_map_camera) @ T_map_tag
    points = SQUARE * size @ T[:3, :3].T + T[:3, 3]
    if (points[:, 2] < 0.1).any() or T[2, 2] > -0.2:
        return None
    pixels = points @ K.T
    pixels = pixels[:, :2] / pixels[:, 2:]
    inside = (pixels > 0).all() and (pixels < [640, 480]).all()
    return pixels if inside else None


def world(
    random,
    cameras,
    tags,
    sigma_px=0.0,
    size_of=None,
    place_of=None,
    odometry=None,
    larger_px=0.0,
    lasting=0.0,
):
    """The problem of these views.

    Args:
        lasting: correlation of the errors of a tag's corners from one sighting to the next.
        size_of: tag -> its true size; all are said to be SIZE.
        place_of: (tag, view) -> T_map_tag; by default it stands still.
        larger_px: by how much tags are seen too large.
    """
    from ros_visualise.estimation.mapping.outward import outward_steps

    seen = []
    errors = {}
    for view, T in enumerate(cameras):
        for tag, stands in enumerate(tags):
            there = place_of(tag, view) if place_of else [stands]
            for place in there if isinstance(there, list) else [there]:
                corners = corners_seen(T, place, size_of(tag) if size_of else SIZE)
                if corners is None:
                    continue
                corners = corners + larger_px * outward_steps(corners)
                new = sigma_px * random.standard_normal((4, 2))
                if tag in errors:
                    new = lasting * errors[tag] + np.sqrt(1 - lasting**2) * new
                errors[tag] = new
                seen.append((view, tag, corners + errors[tag]))
    count = len(seen)
    found = squares_poses(
        [corners for *_, corners in seen], [SIZE] * count, INFO, [max(sigma_px, 0.05)] * count
    )
    sightings = [
        TagSighting(*one, SIZE, INFO, [hypothesis(pose) for pose in poses])
        for one, poses in zip(seen, found, strict=True)
        if poses
    ]
    names = [f"tag36h11_{number}" for number in range(len(tags))]
    stamps = 10**9 + 10**8 * np.arange(len(cameras))
    told = None if odometry is None else CameraPath(odometry)
    return Problem(stamps, names, sightings, told)


def hypothesis(pose):
    """A pose as a detector tells it."""
    return Hypothesis("tag", pose.probability, pose.position_xyz, pose.quat_xyzw, pose.covariance)


def drifting(random, cameras, noise):
    """What an odometry with this noise tells of a flight, right at its beginning."""
    told = [cameras[0]]
    for before, after in pairwise(cameras):
        step = inverse(before) @ after
        way = np.linalg.norm(step[:3, 3])
        sigma = [
            np.sqrt(way * s**2 + still**2)
            for s, still in [(noise.way_m, noise.still_m)] * 3
            + [(noise.tilt_rad, noise.still_rad)] * 2
            + [(noise.heading_rad, noise.still_rad)]
        ]
        off = np.array(sigma) * random.standard_normal(6)
        up = told[-1][:3, :3].T  # from the upright axes to those of the camera
        wrong = from_parts(turn(up @ off[3:]) @ step[:3, :3], step[:3, 3] + up @ off[:3])
        told.append(told[-1] @ wrong)
    return np.array(told)


def quat(T):
    """Of (4, 4)."""
    return rotations.from_matrix(T[:3, :3])

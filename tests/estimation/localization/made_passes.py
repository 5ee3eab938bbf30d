"""Robots that pass landmarks whose poses are known, with errors drawn as the filter is told."""

from __future__ import annotations

import math

import cv2
import numpy as np

from ros_visualise.data import Detection, Detections, Header, Hypothesis
from ros_visualise.geometry import rotations
from ros_visualise.geometry.se3 import from_parts

SECOND = 1_000_000_000
DOWN = np.diag([1.0, -1.0, -1.0])  # R_fixed_camera of a camera that looks straight down


def turn(vector):
    """(3, 3) of a rotation vector."""
    return cv2.Rodrigues(np.asarray(vector, float))[0]


def looking(camera, at):
    """T_fixed_camera (4, 4) of a camera that looks at a point, its x axis level."""
    z = np.subtract(at, camera) / np.linalg.norm(np.subtract(at, camera))
    x = np.cross(z, [0, 0, 1.0])
    x /= np.linalg.norm(x)
    return from_parts(np.column_stack([x, np.cross(z, x), z]), camera)


def misled(T, error):
    """What the frames tell of a camera, where the robot's error (6,) is this one."""
    wrong = T.copy()
    wrong[:3, :3] = turn(-np.asarray(error[3:])) @ T[:3, :3]
    wrong[:3, 3] -= error[:3]
    return wrong


def tag_seen(T, position, R, covariance, random=None, class_id="tag36h11_3", score=1.0):
    """A hypothesis of a tag's pose, in the camera's frame, with noise of this covariance (6, 6)."""
    noise = np.zeros(6) if random is None else random.multivariate_normal(np.zeros(6), covariance)
    at = T[:3, :3].T @ (position - T[:3, 3]) + noise[:3]
    quat = rotations.from_matrix(turn(noise[3:]) @ T[:3, :3].T @ R)
    return Hypothesis(class_id, score, at, quat, covariance, 3)


def direction_seen(T, position, sigma, random=None, class_id="helipad"):
    """A hypothesis of a direction alone, with noise of ``sigma`` radians across it."""
    ray = T[:3, :3].T @ (np.asarray(position) - T[:3, 3])
    ray /= np.linalg.norm(ray)
    if random is not None:
        noise = sigma * random.standard_normal(3)
        ray = ray + noise - ray * (noise @ ray)
        ray /= np.linalg.norm(ray)
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = sigma**2 * np.eye(3) + 1e6 * np.outer(ray, ray)
    covariance[3:, 3:] = 1e6 * np.eye(3)
    return Hypothesis(class_id, 0.9, ray, covariance=covariance, number=1)


def detections(time_s, *several):
    """One message; each of several is the hypotheses of one detection."""
    found = [
        Detection(np.array([320.0, 240]), np.array([40.0, 40]), hypotheses=tuple(hypotheses))
        for hypotheses in several
    ]
    header = Header(round(time_s * SECOND) + SECOND, "camera")
    return Detections(header=header, detections=tuple(found))


def tag_noise(range_m):
    """(6, 6) of a tag of 0.2 m, its axes those of the camera: far things are seen worse."""
    along, across, tilt = 0.002 * range_m**2, 0.0005 * range_m, math.radians(0.5) * range_m
    return np.diag(np.square([across, across, along, tilt, tilt, tilt / 4]))

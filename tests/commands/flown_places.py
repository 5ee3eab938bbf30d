"""Recordings of flights over a drawn ground that has tags only at its start."""

from dataclasses import replace

import cv2
import numpy as np
import visual_flight
from visual_flight import Flight

from ros_visualise.data import (
    CameraInfo,
    Header,
    Image,
    Odometry,
    Transforms,
    TransformStamped,
)
from ros_visualise.geometry import rotations
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import open_recorder

SIDE_M = 0.5
FIRST_NS = 1_600_000_000_000_000_000
TOPICS = {
    "/tf_static": Transforms,
    "/tf": Transforms,
    "/odom": Odometry,
    "/camera_info": CameraInfo,
    "/image_raw": Image,
}
_TAGS = {1: (1.6, 0.4), 2: (2.6, -0.5), 3: (3.2, 0.6)}
"""Ids and centres (x, y), metres."""


def ground():
    """The texture of `visual_flight` with tags."""
    texture = visual_flight._texture().copy()
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    for number, (x, y) in _TAGS.items():
        side = round(SIDE_M * 60)
        tag = cv2.flip(cv2.aruco.generateImageMarker(dictionary, number, side), 0)
        tag = cv2.copyMakeBorder(tag, 6, 6, 6, 6, cv2.BORDER_CONSTANT, value=255)
        u, v = round((x + 2) * 60), round((y + 8) * 60)
        half = len(tag) // 2
        texture[v - half : v - half + len(tag), u - half : u - half + len(tag)] = tag
    return texture


def write_flight(path, numbers, start_m=0.0):
    """Record the drawn images with these numbers, 5 a second, and the exact motion of the camera.

    Args:
        path: an .mcap that does not exist.
        numbers: of the images.
        start_m: x of the origin of odom; that of the world is the first flight's.
    """
    flight = Flight()
    topics = {name: TopicType(kind.type_name) for name, kind in TOPICS.items()}
    with open_recorder(path, topics, live=False) as recorder:
        static = _frame(FIRST_NS, "base_link", "camera", np.zeros(3), np.array([0.0, 0, 0, 1]))
        recorder.write("/tf_static", static, FIRST_NS)
        for n, number in enumerate(numbers):
            at = Header(FIRST_NS + n * 200_000_000, "odom")
            place, quat = (
                flight.p(number) - [start_m, 0, 0],
                rotations.from_matrix(flight.R(number)),
            )
            still = np.zeros(3)
            known = 1e-4 * np.eye(6)
            moved = Odometry(place, quat, still, still, known, known, "base_link", at)
            image = replace(at, frame_id="camera")
            info = replace(flight.info, header=image)
            recorder.write(
                "/tf", _frame(at.stamp_ns, "odom", "base_link", place, quat), at.stamp_ns
            )
            recorder.write("/odom", moved, at.stamp_ns)
            recorder.write("/camera_info", info, at.stamp_ns)
            recorder.write("/image_raw", Image(flight.image(number), "mono8", image), at.stamp_ns)
    return path


def _frame(stamp_ns, parent, child, place, quat):
    return Transforms((TransformStamped(child, place, quat, Header(stamp_ns, parent)),))

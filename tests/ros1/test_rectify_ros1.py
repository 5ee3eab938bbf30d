"""The executable `rectify` beside image_proc's node on the same images."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import rospy
from peers import running
from ros_graph import Heard, wait_for
from sensor_msgs.msg import CameraInfo, Image

IMAGE_PROC = Path("/usr/lib/image_proc/image_proc")
MODELS = {
    "plumb_bob": [-0.26, 0.08, 0.004, -0.003, 0.01],
    "rational_polynomial": [0.3, -0.1, 0.004, -0.003, 0.01, 0.4, -0.05, 0.02],
    "equidistant": [0.1, -0.02, 0.01, 0.003],
}
TURN, _ = cv2.Rodrigues(np.array([0.03, -0.05, 0.02]))
K = [250.0, 0, 161.3, 0, 255, 118.2, 0, 0, 1]
P = [230.0, 0, 158, -20, 0, 231, 121, 0, 0, 0, 1, 0]


def picture() -> np.ndarray:
    noise = np.random.default_rng(1).integers(0, 256, (30, 40, 3), np.uint8)
    return cv2.resize(noise, (320, 240), interpolation=cv2.INTER_CUBIC)


def image_of(pixels: np.ndarray) -> Image:
    height, width = pixels.shape[:2]
    encoding = "bgr8" if pixels.ndim == 3 else f"mono{8 * pixels.itemsize}"
    data = np.ascontiguousarray(pixels).tobytes()
    return Image(height=height, width=width, encoding=encoding, step=len(data) // height, data=data)


def cases() -> list[tuple[Image, CameraInfo]]:
    """Every model and depth; and a part of the sensor, whose pixels are joined by twos."""
    found = []
    pixels = picture()
    for model, D in MODELS.items():
        info = CameraInfo(height=240, width=320, distortion_model=model, D=D, K=K, P=P)
        info.R = TURN.ravel().tolist()
        gray = pixels[..., 0].astype(np.uint16) * 200
        found += [(image_of(pixels), info), (image_of(gray), info)]
    cut = CameraInfo(height=240, width=320, distortion_model="plumb_bob", K=K, P=P)
    cut.D, cut.R = MODELS["plumb_bob"], TURN.ravel().tolist()
    cut.binning_x = cut.binning_y = 2
    cut.roi.x_offset, cut.roi.y_offset, cut.roi.width, cut.roi.height = 40, 20, 200, 160
    return [*found, (image_of(pixels[20:180:2, 40:240:2]), cut)]


@pytest.mark.skipif(not IMAGE_PROC.exists(), reason="on Debian: apt install ros-image-proc")
def test_its_images_are_those_of_image_proc(ros_master, start, hear):
    start("rectify", "image_raw:=lens/image_raw", "image_rect:=lens/ours")
    ours, infos = hear("lens/ours", Image), hear("lens/ours/camera_info", CameraInfo)
    gray, color = hear("lens/image_rect", Image), hear("lens/image_rect_color", Image)
    images = rospy.Publisher("lens/image_raw", Image, queue_size=1)
    calibrations = rospy.Publisher("lens/camera_info", CameraInfo, queue_size=1)
    with running(ros_master, str(IMAGE_PROC), "__ns:=lens"):
        for number, (image, info) in enumerate(cases(), 1):
            stamp = rospy.Time(number)
            image.header.stamp = info.header.stamp = stamp
            image.header.frame_id = info.header.frame_id = "cam"
            info.P = [*P[:3], -number, *P[4:]]
            theirs = color if image.encoding == "bgr8" else gray

            def shown(info=info, image=image, theirs=theirs, stamp=stamp) -> Any:
                calibrations.publish(info)
                images.publish(image)
                time.sleep(0.05)
                is_there = all(one.since(stamp) for one in (ours, infos, theirs))
                return is_there and newest(infos).P[3] == info.P[3] / (info.binning_x or 1)

            wait_for(shown, f"image {number}")
            assert_same(newest(ours), newest(theirs))
            assert not any(newest(infos).D)
            assert newest(infos).K[0] == newest(infos).P[0] == 230 / (info.binning_x or 1)


def newest(heard: Heard) -> Any:
    return heard.messages[-1]


def assert_same(ours: Image, theirs: Image) -> None:
    assert (ours.width, ours.height) == (theirs.width, theirs.height)
    assert (ours.encoding, ours.header.frame_id) == (theirs.encoding, theirs.header.frame_id)
    assert ours.header.stamp == theirs.header.stamp
    assert ours.data == theirs.data

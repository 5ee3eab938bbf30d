"""The node that rectifies: what it refuses, and what goes with what it gives."""

from dataclasses import replace

import numpy as np
import pytest

from ros_visualise.core.errors import UnsupportedImage
from ros_visualise.data import CameraInfo, Header, Image
from ros_visualise.nodes.rectify import RectifyParams, rectify

K = np.array([[40.0, 0, 31], [0, 41.0, 23], [0, 0, 1]])
INFO = CameraInfo(48, 64, K, np.array([-0.2, 0.05, 0, 0, 0]))
PIXELS = np.add.outer(np.arange(48), np.arange(64)).astype(np.uint8)
IMAGE = Image(PIXELS, "mono8", Header(5, "cam"), INFO)


def test_an_image_keeps_all_but_its_pixels_and_its_calibration():
    found = rectify(IMAGE, RectifyParams())
    assert (found.encoding, found.header) == ("mono8", IMAGE.header)
    assert not found.camera_info.D.any()
    assert (found.pixels != IMAGE.pixels).any()


@pytest.mark.parametrize(
    ("image", "expected"),
    [
        (replace(IMAGE, encoding="bayer_rggb8"), "filters.demosaic=true, and rectify its result"),
        (
            replace(IMAGE, camera_info=replace(INFO, width=65)),
            "calibration for 65x48 does not fit images of 64x48",
        ),
    ],
)
def test_what_cannot_be_rectified_is_refused(image, expected):
    with pytest.raises(UnsupportedImage, match=expected):
        rectify(image, RectifyParams())


def test_an_image_without_a_calibration_is_left_out():
    assert rectify(replace(IMAGE, camera_info=None), RectifyParams()) is None
    assert rectify.declared.calibrated  # so that it is said, once

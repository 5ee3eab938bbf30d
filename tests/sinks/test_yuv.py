"""Images as a video encoder takes them."""

import cv2
import numpy as np
import pytest

from ros_visualise.data import MEASUREMENTS, Image
from ros_visualise.sinks.mp4 import to_i420
from ros_visualise.vision.measurements import to_picture


@pytest.mark.parametrize("encoding", MEASUREMENTS)
def test_depth_and_other_measurements_are_recorded_in_colours(encoding):
    dtype, channels = MEASUREMENTS[encoding]
    values = np.arange(1, 1 + 8 * 12 * channels).reshape(8, 12, channels) % 100
    pixels = values.astype(dtype)[..., 0] if channels == 1 else values.astype(dtype)
    planes = to_i420(Image(pixels, encoding), (12, 8))
    np.testing.assert_array_equal(planes, cv2.cvtColor(to_picture(pixels), cv2.COLOR_BGR2YUV_I420))

"""Moving objects in images of a stationary camera."""

import numpy as np
import pytest

from ros_visualise.core.errors import UnsupportedImage
from ros_visualise.core.params import update
from ros_visualise.data import Header, Image
from ros_visualise.nodes import find
from ros_visualise.nodes.motion_detector import MotionParams


def run(count, encoding="bgr8", **changes):
    """Answers to images of noise; after 60 of them a bright square goes to the right."""
    params, rng = update(MotionParams(), changes), np.random.default_rng(0)
    node = find("motion_detector").make(params)
    for k in range(count):
        pixels = rng.integers(80, 90, (120, 200), np.uint8)
        if k >= 60:
            pixels[50:70, 4 * (k - 60) : 4 * (k - 60) + 30] = 200
        pixels = np.dstack([pixels] * 3) if encoding == "bgr8" else pixels.astype("<u2") * 257
        yield node.step(Image(pixels, encoding, Header(k * 40_000_000, "camera")), params)


@pytest.mark.parametrize("encoding", ["bgr8", "mono16"])
def test_the_box_of_what_moves(encoding):
    answers = list(run(80, encoding))
    assert not answers[0]["detections"].detections
    (one,) = answers[-1]["detections"].detections
    assert one.center_uv == pytest.approx([4 * 19 + 14.5, 59.5], abs=3)
    assert one.size_uv == pytest.approx([30, 20], abs=5)
    assert one.class_id == "moving"
    assert 0.5 < one.score <= 1
    assert answers[-1]["debug_image"].pixels.shape == (120, 200, 3)


def test_small_things_are_ignored():
    assert not list(run(70, min_side=40))[-1]["detections"].detections


def test_measurements_have_no_motion():
    params = MotionParams()
    depth = Image(np.zeros((4, 4), np.float32), "32FC1", Header(0, "camera"))
    with pytest.raises(UnsupportedImage):
        find("motion_detector").make(params).step(depth, params)

import threading

import numpy as np
import pytest

from ros_visualise.data import (
    ENCODINGS,
    MEASUREMENTS,
    Deferred,
    Image,
    Odometry,
    Path,
    PolygonStamped,
    PoseArray,
    PoseStamped,
)


@pytest.mark.parametrize("encoding", ENCODINGS | MEASUREMENTS)
def test_an_image_of_every_encoding_keeps_its_pixels(encoding):
    dtype, channels = (ENCODINGS | MEASUREMENTS)[encoding]
    shape = (3, 5) if channels == 1 else (3, 5, channels)
    pixels = np.arange(np.prod(shape)).reshape(shape).astype(dtype)
    image = Image(pixels, encoding)
    np.testing.assert_array_equal(image.pixels, pixels)
    assert (image.height, image.width, image.is_color) == (3, 5, channels > 1)


def test_pixels_are_shared_and_cannot_be_written():
    pixels = np.zeros((2, 2), np.uint8)
    image = Image(pixels, "mono8")
    assert np.shares_memory(image.pixels, pixels)
    with pytest.raises(ValueError, match="read-only"):
        image.pixels[0, 0] = 1
    pixels[0, 0] = 1  # the array of whoever made it stays theirs


@pytest.mark.parametrize(
    ("shape", "dtype", "encoding"),
    [
        ((2, 2), np.uint16, "mono8"),
        ((2, 2), np.uint8, "bgr8"),
        ((2, 2, 4), np.uint8, "bgr8"),
        ((2, 2, 1, 3), np.uint8, "bgr8"),
        ((2, 2), np.uint8, "8UC1"),
    ],
)
def test_shape_and_type_must_fit_the_encoding(shape, dtype, encoding):
    with pytest.raises(ValueError, match=encoding):
        Image(np.zeros(shape, dtype), encoding)


def test_deferred_pixels_are_made_once_whoever_asks():
    made = []
    start = threading.Barrier(4)

    def make():
        made.append(1)
        return np.full((2, 3), 7, np.uint8)

    image = Image(Deferred((2, 3), np.uint8, make), "mono8")
    assert (image.height, image.width, made) == (2, 3, [])
    seen = []

    def look():
        start.wait()
        seen.append(image.pixels)

    threads = [threading.Thread(target=look) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert made == [1]
    assert all(pixels is seen[0] for pixels in seen)
    assert not seen[0].flags.writeable


@pytest.mark.parametrize(
    ("make", "wrong"),
    [
        (lambda: PoseStamped(np.zeros(2), np.zeros(4)), "PoseStamped.position_xyz"),
        (lambda: PoseStamped(np.zeros(3), np.zeros(3)), "PoseStamped.quat_xyzw"),
        (lambda: Odometry(np.zeros(3), np.zeros(4), np.zeros(1)), "Odometry.linear_xyz"),
        (
            lambda: Odometry(np.zeros(3), np.zeros(4), twist_covariance=np.zeros(36)),
            "Odometry.twist_covariance",
        ),
        (lambda: Path(np.zeros(2), np.zeros((2, 3)), np.zeros((1, 4))), "Path.quats_xyzw"),
        (lambda: Path(np.zeros(2), np.zeros((3, 2)), np.zeros((2, 4))), "Path.positions_xyz"),
        (lambda: PoseArray(np.zeros((2, 3)), np.zeros((1, 4))), "PoseArray.quats_xyzw"),
        (lambda: PolygonStamped(np.zeros((4, 2))), "PolygonStamped.points_xyz"),
    ],
)
def test_poses_of_other_shapes_are_refused_by_name(make, wrong):
    with pytest.raises(ValueError, match=wrong):
        make()


def test_poses_are_numbers_that_cannot_be_written():
    pose = PoseStamped([1, 2, 3], [0, 0, 0, 1])
    assert pose.position_xyz.dtype == pose.quat_xyzw.dtype == np.float64
    with pytest.raises(ValueError, match="read-only"):
        pose.position_xyz[0] = 2

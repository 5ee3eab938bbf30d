"""Images and calibrations in messages of sensor_msgs, and back."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from through import HEADER, ROS1, ROS2, assert_survives, through_ros1, through_ros2

from ros_visualise.core.errors import TooLarge
from ros_visualise.data import (
    ENCODINGS,
    MEASUREMENTS,
    CameraInfo,
    CompressedImage,
    Header,
    Image,
)
from ros_visualise.messages import from_message, to_message

EVERY = ENCODINGS | MEASUREMENTS


def random_image(encoding: str, height: int = 3, width: int = 5) -> Image:
    """Random bytes: of floats, some are no numbers."""
    dtype, channels = EVERY[encoding]
    shape = (height, width) if channels == 1 else (height, width, channels)
    size = height * width * channels * np.dtype(dtype).itemsize
    raw = np.random.default_rng(7).integers(0, 256, size, np.uint8)
    return Image(raw.view(dtype).reshape(shape), encoding, HEADER)


@pytest.mark.parametrize("size", [(3, 5), (1, 1), (8, 2)])
@pytest.mark.parametrize("encoding", EVERY)
@pytest.mark.parametrize("through", [through_ros1, through_ros2])
def test_images_survive(through: Callable[..., Any], encoding: str, size: tuple[int, int]) -> None:
    image = random_image(encoding, *size)
    found = from_message(through(image), Image)
    assert (found.encoding, found.header) == (encoding, HEADER)
    assert (found.pixels.dtype, found.pixels.shape) == (image.pixels.dtype, image.pixels.shape)
    assert found.pixels.tobytes() == image.pixels.tobytes()


def test_pixels_are_not_copied_on_the_way_out() -> None:
    image = random_image("bgr16")
    assert np.shares_memory(to_message(image, ROS2.types).data, image.pixels)


def test_a_cut_out_is_written_as_it_looks() -> None:
    whole = random_image("bgr8", 8, 8)
    cut = replace(whole, data=whole.pixels[2:5, 1:4])
    message = through_ros2(cut)
    assert message.step == 9
    np.testing.assert_array_equal(from_message(message, Image).pixels, whole.pixels[2:5, 1:4])


def message(encoding: str, height: int, width: int, step: int, data: Any, big: int = 0) -> Any:
    types = ROS2.types
    stamp = types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    return types["sensor_msgs/msg/Image"](
        header=types["std_msgs/msg/Header"](stamp=stamp, frame_id=""),
        encoding=encoding,
        height=height,
        width=width,
        step=step,
        is_bigendian=big,
        data=np.frombuffer(data, np.uint8),
    )


def test_padding_at_the_rows_ends_is_left_out() -> None:
    found = from_message(message("mono8", 2, 3, 4, bytes([1, 2, 3, 99, 4, 5, 6, 99])), Image)
    np.testing.assert_array_equal(found.pixels, [[1, 2, 3], [4, 5, 6]])


def test_padding_may_be_odd_for_16_bit() -> None:
    found = from_message(message("mono16", 2, 1, 3, bytes([1, 2, 99, 3, 4, 99])), Image)
    np.testing.assert_array_equal(found.pixels, [[0x0201], [0x0403]])


def test_big_endian_is_turned() -> None:
    found = from_message(message("mono16", 1, 2, 4, bytes([1, 2, 3, 4]), big=1), Image)
    np.testing.assert_array_equal(found.pixels, [[0x0102, 0x0304]])
    assert found.pixels.dtype == np.uint16


@pytest.mark.parametrize(
    ("step", "size", "expected"),
    [
        (6, 11, "12 bytes, but the message holds 11"),
        (6, 13, "12 bytes, but the message holds 13"),
        (5, 10, "a row of 2 bgr8 pixels needs 6 bytes, but the step is 5"),
        (0, 0, "a row of 2 bgr8 pixels needs 6 bytes, but the step is 0"),
    ],
)
def test_sizes_that_contradict_are_refused(step: int, size: int, expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        from_message(message("bgr8", 2, 2, step, bytes(size)), Image)


def test_an_image_without_pixels_is_refused() -> None:
    for height, width in ((0, 0), (0, 4), (4, 0)):
        for encoding in ("mono8", "32FC1", "yuv422", "nv12"):
            with pytest.raises(ValueError, match=f"an image of {width}x{height} pixels"):
                from_message(message(encoding, height, width, width, b""), Image)


@pytest.mark.parametrize("name", ["", "theora", "mono32", "8UC5", "16FC1", "32UC1", "16UC", "nv16"])
def test_an_unknown_encoding_is_refused_by_name(name: str) -> None:
    with pytest.raises(ValueError, match=rf"'{name}'; supported: mono8, mono16, .*32FC1.*nv12"):
        from_message(message(name, 1, 2, 4, bytes(4)), Image)


def test_depth_keeps_its_values_and_its_name() -> None:
    metres = np.array([[0.5, np.nan], [np.inf, 0]], np.float32)
    found = from_message(message("32FC1", 2, 2, 8, metres.tobytes()), Image)
    assert found.encoding == "32FC1"
    np.testing.assert_array_equal(found.pixels, metres)
    millimetres = np.array([[500, 0]], ">u2")
    found = from_message(message("16UC1", 1, 2, 4, millimetres.tobytes(), big=1), Image)
    assert found.encoding == "16UC1"
    np.testing.assert_array_equal(found.pixels, [[500, 0]])
    assert through_ros2(found).encoding == "16UC1"


def test_depth_of_another_size_is_refused() -> None:
    with pytest.raises(
        ValueError, match=r"32FC1 of 2x2 .* needs 16 bytes, but the message holds 15"
    ):
        from_message(message("32FC1", 2, 2, 8, bytes(15)), Image)


@pytest.mark.parametrize(
    ("name", "encoding"),
    [
        ("8UC1", "mono8"),
        ("8UC3", "bgr8"),
        ("8UC4", "bgra8"),
        ("16UC3", "bgr16"),
        ("16UC4", "bgra16"),
    ],
)
def test_the_names_of_opencv_are_read_as_cv_bridge_reads_them(name: str, encoding: str) -> None:
    image = random_image(encoding)
    sent = replace(to_message(image, ROS2.types), encoding=name)
    found = from_message(sent, Image)
    assert found.encoding == encoding
    np.testing.assert_array_equal(found.pixels, image.pixels)
    assert np.shares_memory(found.pixels, image.pixels)


# luma 16-235, chroma around 128, by ITU-R BT.601
RED, BLUE, WHITE = (82, 90, 240), (41, 240, 110), (235, 128, 128)


@pytest.mark.parametrize(
    ("encoding", "order"),
    [("yuv422", "UYVY"), ("uyvy", "UYVY"), ("yuv422_yuy2", "YUYV"), ("yuyv", "YUYV")],
)
def test_what_usb_cameras_send_is_read_as_bgr8(encoding: str, order: str) -> None:
    data = b""
    for y, u, v in (RED, BLUE, WHITE):
        values = {"U": [u], "V": [v], "Y": [y, y]}
        data += bytes(values[name].pop() for name in order)
    found = from_message(message(encoding, 3, 2, 4, data), Image)
    assert (found.encoding, found.height, found.width) == ("bgr8", 3, 2)
    expected = np.repeat(np.array([[[0, 0, 255]], [[255, 0, 0]], [[255, 255, 255]]]), 2, axis=1)
    np.testing.assert_allclose(found.pixels, expected, atol=3)


@pytest.mark.parametrize("padding", [0, 2])
@pytest.mark.parametrize(("encoding", "order"), [("nv12", "UV"), ("nv21", "VU")])
def test_pairs_of_colours_for_four_pixels_are_read_as_bgr8(
    encoding: str, order: str, padding: int
) -> None:
    colors = (RED, BLUE, WHITE)
    gray = [value for y, _, _ in colors for value in (y, y)]
    pairs = [{"U": u, "V": v}[one] for _, u, v in colors for one in order]
    rows = [bytes(row) + b"\xff" * padding for row in (gray, gray, pairs)]
    found = from_message(message(encoding, 2, 6, 6 + padding, b"".join(rows)), Image)
    assert (found.encoding, found.height, found.width) == ("bgr8", 2, 6)
    expected = np.repeat([[[0, 0, 255], [255, 0, 0], [255, 255, 255]]] * 2, 2, axis=1)
    np.testing.assert_allclose(found.pixels, expected, atol=3)


def test_a_pair_of_colours_for_each_pixel_is_read_as_bgr8() -> None:
    gray = bytes([RED[0], BLUE[0], WHITE[0]])
    pairs = bytes([*RED[1:], *BLUE[1:], *WHITE[1:]])
    found = from_message(message("nv24", 1, 3, 3, gray + pairs), Image)
    assert (found.encoding, found.pixels.shape) == ("bgr8", (1, 3, 3))
    np.testing.assert_allclose(found.pixels[0], [[0, 0, 255], [255, 0, 0], [255, 255, 255]], atol=3)


@pytest.mark.parametrize(
    ("encoding", "height", "width", "step", "size", "why"),
    [
        ("yuv422", 1, 3, 6, 6, "yuv422 of 3x1 pixels is not supported: it has an odd"),
        ("nv12", 3, 2, 2, 9, "nv12 of 2x3 pixels is not supported: it has an odd"),
        ("nv21", 2, 3, 3, 9, "nv21 of 3x2 pixels is not supported: it has an odd"),
        ("nv12", 2, 2, 2, 8, "nv12 of 2x2 .* needs 6 bytes, but the message holds 8"),
        ("nv21", 2, 2, 1, 3, "needs 2 bytes, but the step is 1"),
        ("nv24", 2, 2, 2, 8, "needs 12 bytes, but the message holds 8"),
        ("nv24", 2, 2, 4, 24, "nv24 of 2 pixels with a step of 4 bytes is not supported"),
    ],
)
def test_colours_that_do_not_fit_are_refused(
    encoding: str, height: int, width: int, step: int, size: int, why: str
) -> None:
    with pytest.raises(ValueError, match=why):
        from_message(message(encoding, height, width, step, bytes(size)), Image)


@pytest.mark.parametrize("name", ["mono8", "bgr8", "nv12", "yuyv", "32FC1"])
@pytest.mark.parametrize("step", [2**32 - 2, 2**32 - 1, 1, 0])
def test_a_size_that_its_length_contradicts_is_damage_and_not_too_large(
    name: str, step: int
) -> None:
    wide = message(name, 2**32 - 2, 2**32 - 2, step, bytes(10))
    with pytest.raises(
        ValueError, match=r"bytes, but (the message holds 10|the step is)"
    ) as caught:
        from_message(wide, Image)
    assert not isinstance(caught.value, TooLarge)


def test_pixels_are_not_copied_on_the_way_in_and_cannot_be_written() -> None:
    sent = message("bgr8", 2, 2, 6, bytearray(range(12)))
    found = from_message(sent, Image)
    assert np.shares_memory(found.pixels, sent.data)
    with pytest.raises(ValueError, match="read-only"):
        found.pixels[0, 0] = 1


def test_16_bit_at_an_odd_address_is_as_any_other() -> None:
    data = np.frombuffer(bytes(range(9)), np.uint8)[1:]
    found = from_message(replace(message("mono16", 2, 2, 4, b""), data=data), Image)
    assert found.pixels.flags.aligned
    np.testing.assert_array_equal(found.pixels, [[0x0201, 0x0403], [0x0605, 0x0807]])


@pytest.mark.parametrize("stamp_ns", [-1, -(10**9), 2**31 * 10**9, 2**63])
def test_stamps_that_ros_cannot_hold_are_refused(stamp_ns: int) -> None:
    image = replace(random_image("mono8"), header=Header(stamp_ns))
    with pytest.raises(ValueError, match="between 1970 and 2038"):
        to_message(image, ROS1.types)


@pytest.mark.parametrize("stamp_ns", [0, 1, 10**9 - 1, 2**31 * 10**9 - 1])
def test_the_first_and_the_last_stamps_survive(stamp_ns: int) -> None:
    image = replace(random_image("mono8"), header=Header(stamp_ns))
    assert from_message(through_ros1(image), Image).header.stamp_ns == stamp_ns


@pytest.mark.parametrize("through", [through_ros1, through_ros2])
def test_compressed_images_survive(through: Callable[..., Any]) -> None:
    image = CompressedImage(np.arange(9, dtype=np.uint8), "bgr8; jpeg compressed bgr8", HEADER)
    found = from_message(through(image), CompressedImage)
    assert (found.format, found.header) == (image.format, HEADER)
    np.testing.assert_array_equal(found.data, image.data)


CAMERA = CameraInfo(
    height=375,
    width=1242,
    K=np.array([[721.5, 0, 609.6], [0, 722.5, 172.9], [0, 0, 1]]),
    D=np.array([0.1, -0.2, 0.003, 0.004, 0.05]),
    R=np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]),
    P=np.arange(12.0).reshape(3, 4),
)


@pytest.mark.parametrize("through", [through_ros1, through_ros2])
def test_calibrations_survive(through: Callable[..., Any]) -> None:
    message = through(CAMERA, HEADER)
    assert message.header.frame_id == "cam00_optical"
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1_700_000_000, 987_654_321)
    found = from_message(message, CameraInfo)
    assert (found.height, found.width, found.distortion_model) == (375, 1242, "plumb_bob")
    for name in "KDRP":
        np.testing.assert_array_equal(getattr(found, name), getattr(CAMERA, name))


def test_a_calibration_keeps_its_header() -> None:
    assert_survives(replace(CAMERA, header=HEADER))


def test_an_unrectified_camera_projects_by_its_own_matrix() -> None:
    found = from_message(through_ros2(replace(CAMERA, P=None)), CameraInfo)
    np.testing.assert_array_equal(found.P, np.column_stack([CAMERA.K, np.zeros(3)]))


def test_an_uncalibrated_camera_has_its_size_alone() -> None:
    found = from_message(through_ros1(CameraInfo.uncalibrated(480, 640)), CameraInfo)
    assert (found.height, found.width, found.distortion_model) == (480, 640, "")
    assert not found.K.any()
    assert not found.P.any()
    assert len(found.D) == 0
    np.testing.assert_array_equal(found.R, np.eye(3))


def test_a_calibration_is_that_of_the_images_when_the_sensor_is_cut_and_binned() -> None:
    message = through_ros1(CAMERA)
    message.binning_x, message.binning_y = 2, 4
    message.roi.x_offset, message.roi.y_offset = 100, 40
    message.roi.width, message.roi.height = 800, 200
    found = from_message(message, CameraInfo)
    assert (found.width, found.height) == (400, 50)
    expected = [[721.5 / 2, 0, 509.6 / 2], [0, 722.5 / 4, 132.9 / 4], [0, 0, 1]]
    np.testing.assert_allclose(found.K, expected)
    point = np.array([0.3, -0.2, 1, 0])
    u, v, w = CAMERA.P @ point
    np.testing.assert_allclose(found.P @ point, [(u - 100 * w) / 2, (v - 40 * w) / 4, w])
    np.testing.assert_array_equal(found.D, CAMERA.D)

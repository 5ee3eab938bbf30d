"""JPEG and PNG, as compressed_image_transport and many others write them."""

import struct

import cv2
import numpy as np
import pytest

from ros_visualise.data import ENCODINGS, MEASUREMENTS, CompressedImage, Header, Image
from ros_visualise.vision.compression import compress, decompress

HEADER = Header(1_700_000_000_987_654_321, "camera_optical")
SIZE = (24, 40)


def smooth(encoding):
    """An image of gentle slopes, which JPEG keeps well, different in every channel."""
    dtype, channels = ENCODINGS[encoding]
    top = np.iinfo(dtype).max
    y, x = np.mgrid[: SIZE[0], : SIZE[1]] / max(SIZE)
    planes = [0.2 + 0.7 * x, 0.8 - 0.6 * y, 0.1 + 0.2 * (x + y), np.ones(SIZE)]
    pixels = (np.dstack(planes[:channels]) * top).astype(dtype)
    return Image(pixels[..., 0] if channels == 1 else pixels, encoding, HEADER)


def file_of(suffix, pixels):
    return cv2.imencode(suffix, pixels)[1].reshape(-1)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_every_encoding_survives(encoding):
    image = smooth(encoding)
    compressed = compress(image, quality=95)
    found = decompress(compressed)
    assert (found.encoding, found.header, compressed.header) == (encoding, HEADER, HEADER)
    if "jpeg" in compressed.format:
        np.testing.assert_allclose(found.pixels.astype(int), image.pixels, atol=6)
    else:
        np.testing.assert_array_equal(found.pixels, image.pixels)


@pytest.mark.parametrize(
    ("encoding", "expected"),
    [
        ("bgr8", "bgr8; jpeg compressed bgr8"),
        ("rgb8", "rgb8; jpeg compressed bgr8"),
        ("rgba8", "rgba8; jpeg compressed bgr8"),
        ("mono8", "mono8; jpeg compressed "),
        ("mono16", "mono16; png compressed "),
        ("rgb16", "rgb16; png compressed bgr16"),
        ("bayer_rggb8", "bayer_rggb8; png compressed "),
    ],
)
def test_the_format_is_that_of_the_transport(encoding, expected):
    assert compress(smooth(encoding)).format == expected


@pytest.mark.parametrize("encoding", ["bgr8", "rgb8", "rgb16"])
def test_any_viewer_shows_the_right_colours(encoding):
    """What is in the file, by itself, is the picture."""
    image = smooth(encoding)
    shown = cv2.imdecode(compress(image, 95).data, cv2.IMREAD_UNCHANGED)
    expected = image.pixels if encoding == "bgr8" else image.pixels[..., ::-1]
    np.testing.assert_allclose(shown.astype(int), expected, atol=6)


def test_quality_costs_bytes():
    noise = np.random.default_rng(5).integers(0, 255, (64, 64, 3), np.uint8)
    sizes = [compress(Image(noise, "bgr8"), quality).data.size for quality in (20, 60, 95)]
    assert sizes == sorted(set(sizes))


BGR = smooth("bgr8").pixels
GRAY = smooth("mono8").pixels
GRAY_16 = smooth("mono16").pixels


@pytest.mark.parametrize(
    ("format", "pixels", "encoding", "expected"),
    [
        ("png", BGR, "bgr8", BGR),
        ("", BGR, "bgr8", BGR),
        ("png", GRAY, "mono8", GRAY),
        ("png", GRAY_16, "mono16", GRAY_16),
        ("png", smooth("bgra8").pixels, "bgra8", smooth("bgra8").pixels),
        ("png", smooth("bgra16").pixels, "bgra16", smooth("bgra16").pixels),
        ("rgb8; png compressed bgr8", BGR, "rgb8", BGR[..., ::-1]),
        ("rgb8;png compressed bgr8", BGR, "rgb8", BGR[..., ::-1]),
        ("bgra8; png compressed bgr8", BGR, "bgra8", smooth("bgra8").pixels),
        ("bgr8; png compressed ", BGR[..., ::-1], "bgr8", BGR),
        ("rgb8; png compressed ", BGR, "rgb8", BGR),
        ("8UC1; png compressed ", GRAY, "mono8", GRAY),
        ("8UC3; png compressed ", BGR, "bgr8", BGR),
        ("16UC1; png compressed ", GRAY_16, "16UC1", GRAY_16),
        ("16UC1; png compressed ", GRAY, "mono8", GRAY),
        ("yuv422; png compressed bgr8", BGR, "bgr8", BGR),
        ("bayer_rggb8; png compressed bgr8", BGR, "bgr8", BGR),
        ("mono16; png compressed ", GRAY, "mono8", GRAY),
        ("bgr8; png compressed bgr8", GRAY, "bgr8", np.dstack([GRAY] * 3)),
        ("mono8; png compressed ", np.dstack([GRAY] * 3), "mono8", GRAY),
    ],
)
def test_what_others_write_is_read(format, pixels, encoding, expected):
    found = decompress(CompressedImage(file_of(".png", pixels), format, HEADER))
    assert (found.encoding, found.header) == (encoding, HEADER)
    np.testing.assert_array_equal(found.pixels, expected)


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
@pytest.mark.parametrize("part", [0.0, 0.3, 0.9])
def test_a_file_that_is_cut_off_is_refused(suffix, part):
    whole = file_of(suffix, np.random.default_rng(6).integers(0, 255, (50, 50, 3), np.uint8))
    cut = whole[: int(len(whole) * part)]
    with pytest.raises(ValueError, match=f"'jpeg' of {len(cut)} bytes is damaged"):
        decompress(CompressedImage(cut, "jpeg"))


@pytest.mark.parametrize("data", [b"", b"nothing of the kind", b"\xff\xd8\xff\xd9", bytes(1000)])
def test_what_is_no_picture_is_refused(data):
    with pytest.raises(ValueError, match="is damaged"):
        decompress(CompressedImage(np.frombuffer(data, np.uint8), "bgr8; jpeg compressed bgr8"))


def test_depth_in_millimetres_survives_bit_by_bit():
    image = Image(GRAY_16, "16UC1", HEADER)
    compressed = compress(image)
    assert compressed.format == "16UC1; png compressed "
    found = decompress(compressed)
    assert (found.encoding, found.header) == ("16UC1", HEADER)
    np.testing.assert_array_equal(found.pixels, GRAY_16)


@pytest.mark.parametrize("encoding", [name for name in MEASUREMENTS if name != "16UC1"])
def test_other_measurements_are_not_compressed(encoding):
    dtype, channels = MEASUREMENTS[encoding]
    shape = (4, 5) if channels == 1 else (4, 5, channels)
    with pytest.raises(ValueError, match=f"{encoding} holds measurements"):
        compress(Image(np.ones(shape, dtype), encoding))


def depth_file(png, a=0.0, b=0.0):
    """As compressed_depth_image_transport writes it: a header of 12 bytes, and a PNG."""
    return np.frombuffer(struct.pack("<iff", 0, a, b) + png.tobytes(), np.uint8)


@pytest.mark.parametrize("how", ["compressedDepth png", "compressedDepth"])
def test_compressed_depth_in_millimetres_is_read(how):
    compressed = CompressedImage(depth_file(file_of(".png", GRAY_16)), f"16UC1; {how}", HEADER)
    found = decompress(compressed)
    assert (found.encoding, found.header) == ("16UC1", HEADER)
    np.testing.assert_array_equal(found.pixels, GRAY_16)


def test_compressed_depth_in_metres_is_read():
    """Written by the transport's formulas: a tenth of a metre to ten, and places without depth."""
    depth_max, quantization = 10.0, 100.0
    metres = np.linspace(0.5, 9.9, 200, dtype=np.float32).reshape(10, 20)
    a = quantization * (quantization + 1)
    b = 1 - a / depth_max
    stored = (a / metres + b).astype(np.uint16)
    stored[3, 4] = 0
    found = decompress(
        CompressedImage(depth_file(file_of(".png", stored), a, b), "32FC1; compressedDepth png")
    )
    assert (found.encoding, found.pixels.dtype) == ("32FC1", np.float32)
    assert np.isnan(found.pixels[3, 4])
    known = stored > 0
    resolution = metres**2 / a  # of one step at this distance
    assert (np.abs(found.pixels - metres) <= 1.01 * resolution)[known].all()


@pytest.mark.parametrize(
    ("data", "format", "why"),
    [
        (
            depth_file(file_of(".png", GRAY_16)),
            "16UC1; compressedDepth rvl",
            "unsupported compressed",
        ),
        (
            depth_file(file_of(".png", GRAY_16)),
            "bgr8; compressedDepth png",
            "unsupported compressed",
        ),
        (
            depth_file(file_of(".png", GRAY)),
            "16UC1; compressedDepth png",
            "is not a 16-bit gray image",
        ),
        (
            depth_file(file_of(".png", BGR)),
            "32FC1; compressedDepth png",
            "is not a 16-bit gray image",
        ),
        (np.zeros(12, np.uint8), "16UC1; compressedDepth png", "of 12 bytes is damaged"),
        (np.zeros(0, np.uint8), "16UC1; compressedDepth png", "of 0 bytes is damaged"),
        (np.zeros(40, np.uint8), "32FC1; compressedDepth png", "bytes is damaged"),
        (file_of(".tiff", np.zeros((4, 4), np.float32)), "tiff", "'tiff' holds float32 values"),
    ],
)
def test_other_depth_is_refused_by_name(data, format, why):
    with pytest.raises(ValueError, match=why):
        decompress(CompressedImage(data, format))


@pytest.mark.parametrize("shape", [(0, 0), (0, 5), (1, 65501)])
def test_a_size_that_no_file_can_have_is_refused(shape):
    with pytest.raises(ValueError, match=f"of {shape[1]}x{shape[0]} pixels cannot be compressed"):
        compress(Image(np.zeros(shape, np.uint8), "mono8"))

import numpy as np
import pytest

from ros_visualise.data import ENCODINGS, MEASUREMENTS, Image
from ros_visualise.ui.preview import preview


@pytest.mark.parametrize(("encoding", "dtype", "channels"), [(e, *v) for e, v in ENCODINGS.items()])
def test_every_encoding_is_shown_in_8_bits(encoding, dtype, channels):
    shape = (3, 5) if channels == 1 else (3, 5, channels)
    shown = preview(Image(np.full(shape, np.iinfo(dtype).max, dtype), encoding), 720)
    assert shown.dtype == np.uint8
    assert shown.shape == ((3, 5) if channels == 1 else (3, 5, 3))
    assert (shown == 255).all()


def test_colours_come_as_bgr():
    red = np.zeros((2, 2, 3), np.uint8)
    red[..., 0] = 200
    assert preview(Image(red, "rgb8"), 720)[0, 0].tolist() == [0, 0, 200]
    assert preview(Image(red, "bgr8"), 720)[0, 0].tolist() == [200, 0, 0]


@pytest.mark.parametrize("shape", [(1, 1), (1, 5000), (5000, 1), (2160, 3840), (1919, 1079)])
def test_the_longer_side_fits_and_the_shape_stays(shape):
    shown = preview(Image(np.zeros(shape, np.uint8), "mono8"), 720)
    factor = max(max(shape) / 720, 1)
    assert shown.shape == tuple(max(1, round(n / factor)) for n in shape)


def test_a_small_image_is_shown_as_it_is():
    pixels = np.arange(12, dtype=np.uint8).reshape(3, 4)
    assert preview(Image(pixels, "mono8"), 720).tolist() == pixels.tolist()


@pytest.mark.parametrize("factor", [2, 4, 8])
def test_shrinking_takes_the_mean(factor):
    pixels = np.random.default_rng(1).integers(0, 256, (16 * factor, 16 * factor), np.uint8)
    mean = pixels.reshape(16, factor, 16, factor).mean(axis=(1, 3))
    assert np.abs(preview(Image(pixels, "mono8"), 16) - mean).max() <= 2


def test_a_line_of_one_pixel_stays_visible_in_edges():
    edges = np.zeros((2160, 3840), np.uint8)
    edges[:, 1001] = 255
    shown = preview(Image(edges, "mono8"), 720)
    assert shown.max() >= 80  # of a mean, 48
    assert (shown > 0).any(axis=1).all()
    assert (shown > 0).sum(axis=1).max() <= 3


@pytest.mark.parametrize("size", [3, 720])
@pytest.mark.parametrize("encoding", MEASUREMENTS)
def test_measurements_of_every_type_are_shown_in_colours(encoding, size):
    dtype, channels = MEASUREMENTS[encoding]
    values = np.arange(2, 2 + 6 * 10 * channels).reshape(6, 10, channels) % 120
    pixels = values.astype(dtype)
    shown = preview(Image(pixels[..., 0] if channels == 1 else pixels, encoding), size)
    assert (shown.dtype, shown.shape) == (np.uint8, (2, 3, 3) if size == 3 else (6, 10, 3))
    assert len(np.unique(shown.reshape(-1, 3), axis=0)) > 2


def test_depth_is_picked_and_not_mixed_when_it_shrinks():
    """Between what is near and what is far away there is nothing, and no depth stays none."""
    depth = np.zeros((400, 400), np.uint16)
    depth[:, 100:250], depth[:, 250:] = 500, 9000
    shown = preview(Image(depth, "16UC1"), 37)
    assert len(np.unique(shown.reshape(-1, 3), axis=0)) == 3
    assert not shown[:, :9].any()

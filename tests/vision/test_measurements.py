"""Depth as a picture."""

import cv2
import numpy as np
import pytest

from ros_visualise.vision.measurements import to_picture

TURBO = cv2.applyColorMap(np.arange(256, dtype=np.uint8).reshape(256, 1), cv2.COLORMAP_TURBO)[:, 0]


def levels(picture):
    """The place of each colour in the map; 0 is black, which is not in it."""
    table = {tuple(color): level for level, color in enumerate(TURBO.tolist())} | {(0, 0, 0): 0}
    flat = [table[tuple(color)] for color in picture.reshape(-1, 3).tolist()]
    return np.array(flat).reshape(picture.shape[:2])


@pytest.mark.parametrize(
    ("dtype", "values"),
    [
        (np.uint16, np.linspace(400, 9000, 101)),
        (np.float32, np.linspace(0.4, 9, 101)),
        (np.float64, np.linspace(0.4, 9, 101)),
        (np.int16, np.linspace(-3000, -1000, 101)),
        (np.int32, np.linspace(10**6, 10**9, 101)),
        (np.int8, np.linspace(1, 101, 101)),
    ],
)
def test_the_colours_go_evenly_from_low_to_high(dtype, values):
    found = levels(to_picture(values.astype(dtype)[None]))[0]
    expected = np.clip(1 + 254 * (np.arange(101) - 2) / 96, 1, 255)  # of the percentiles 2 to 98
    np.testing.assert_allclose(found, expected, atol=1.5)


def test_the_scale_does_not_depend_on_the_unit():
    metres = np.random.default_rng(1).uniform(0.5, 20, (50, 60))
    one, other = (
        to_picture(metres.astype(np.float32)),
        to_picture((metres * 1000).astype(np.uint16)),
    )
    assert np.abs(levels(one) - levels(other)).max() <= 1


def test_a_few_strays_do_not_take_the_colours_of_the_rest():
    depth = np.tile(np.linspace(1, 2, 100, dtype=np.float32), (100, 1))
    calm = levels(to_picture(depth))
    depth[50, 50], depth[20, 20] = 1e6, 1e-6
    strayed = levels(to_picture(depth))
    assert strayed[50, 50] == 255
    assert strayed[20, 20] == 1
    strayed[50, 50], strayed[20, 20] = calm[50, 50], calm[20, 20]
    assert np.abs(strayed - calm).max() <= 4  # by lowest and highest it would be 254


@pytest.mark.parametrize("none", [0.0, np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_what_is_no_value_is_black(none, dtype):
    depth = np.tile(np.linspace(1, 2, 40, dtype=dtype), (30, 1))
    depth[:10] = none
    picture = to_picture(depth)
    assert not picture[:10].any()
    assert picture[10:].any(axis=2).all()
    assert not to_picture(np.full((3, 4), none, dtype)).any()


def test_no_millimetres_are_black():
    picture = to_picture(np.array([[0, 700], [800, 0]], np.uint16))
    assert picture.any(axis=2).tolist() == [[False, True], [True, False]]


def test_the_same_everywhere_is_one_colour_in_the_middle():
    assert (levels(to_picture(np.full((5, 5), 1234, np.uint16))) == 128).all()


@pytest.mark.parametrize("shape", [(1, 1), (1, 500), (500, 1), (0, 5), (3, 0)])
def test_any_size_will_do(shape):
    assert to_picture(np.ones(shape, np.float32)).shape == (*shape, 3)


def test_of_two_channels_the_length_is_shown():
    flow = np.random.default_rng(2).normal(size=(20, 30, 2)).astype(np.float32)
    length = np.hypot(flow[..., 0], flow[..., 1])
    np.testing.assert_array_equal(to_picture(flow), to_picture(length.astype(np.float64)))


def test_more_channels_are_colours():
    values = np.zeros((4, 4, 3), np.float32)
    values[..., 0], values[..., 2] = 0.25, 0.75
    blue, green, red = to_picture(values)[0, 0]
    assert green == 0 < blue < red
    with_alpha = np.dstack([values, np.full((4, 4), 9, np.float32)])
    np.testing.assert_array_equal(to_picture(with_alpha), to_picture(values))

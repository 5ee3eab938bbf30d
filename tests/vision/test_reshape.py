import numpy as np
import pytest
from by_definition import differ_by

from ros_visualise.vision.reshape import Flip, flip, resize, target_size


@pytest.mark.parametrize(
    ("asked", "expected"),
    [
        ((1.0, 0, 0), (101, 67)),
        ((0.5, 0, 0), (50, 34)),
        ((0.01, 0, 0), (1, 1)),
        ((2.0, 0, 0), (202, 134)),
        ((2.0, 40, 30), (40, 30)),
        ((1.0, 202, 0), (202, 134)),
        ((1.0, 0, 134), (202, 134)),
        ((1.0, 1, 0), (1, 1)),
    ],
)
def test_target_size(asked, expected):
    assert target_size((101, 67), *asked) == expected


def test_half_size_is_the_mean_of_four(dtype):
    top = np.iinfo(dtype).max
    image = np.random.default_rng(8).integers(0, top + 1, (6, 10, 3), dtype)
    expected = image.reshape(3, 2, 5, 2, 3).astype(float).mean((1, 3))
    assert np.abs(resize(image, (5, 3)) - expected).max() <= 0.5


def test_enlarging_interpolates_between_pixel_centres(dtype):
    row = np.array([[0, 100, 200]], dtype)
    centres = (np.arange(6) + 0.5) / 2 - 0.5
    expected = np.interp(centres, [0, 1, 2], row[0])
    assert np.abs(resize(row, (6, 1)) - expected).max() <= 0.5


def test_every_size_of_every_kind(gray, colored):
    for image in (gray, colored, np.dstack((colored, gray))):
        for size in ((1, 1), (3, 2), (64, 48)):
            assert resize(image, size).shape == (size[1], size[0], *image.shape[2:])


@pytest.mark.parametrize("way", [Flip.HORIZONTAL, Flip.VERTICAL, Flip.BOTH])
def test_flip(gray, colored, way):
    rows = slice(None, None, -1 if way.vertical else 1)
    columns = slice(None, None, -1 if way.horizontal else 1)
    for image in (gray, colored, np.dstack((colored, gray))):
        assert differ_by(flip(image, way), image[rows, columns]) == 0
        assert differ_by(flip(flip(image, way), way), image) == 0


def test_off_is_the_same_array(gray):
    assert flip(gray, Flip.OFF) is gray
    assert resize(gray, (gray.shape[1], gray.shape[0])) is gray

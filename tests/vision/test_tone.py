import numpy as np
import pytest
from by_definition import differ_by

from ros_visualise.vision.color import to_gray
from ros_visualise.vision.tone import Equalize, adjust, equalize


def spread(gray):
    """Histogram equalization by its definition."""
    top = np.iinfo(gray.dtype).max
    darkest = (gray == gray.min()).sum()
    if darkest == gray.size:
        return gray
    up_to = np.array([(gray <= value).sum() for value in gray.ravel()]).reshape(gray.shape)
    return np.rint((up_to - darkest) / (gray.size - darkest) * top).astype(gray.dtype)


@pytest.mark.parametrize(
    ("contrast", "brightness"), [(1.5, 0), (1, -40), (0.5, 30), (2, 255), (0, 9)]
)
def test_adjust(gray, contrast, brightness):
    top = np.iinfo(gray.dtype).max
    expected = (contrast * gray.astype(float) + brightness * (top // 255)).clip(0, top)
    assert np.abs(adjust(gray, contrast, brightness) - expected).max() <= 0.5


def test_adjust_works_on_each_channel(colored):
    found = adjust(colored, 0.7, 20)
    for channel in range(3):
        single = adjust(colored[..., channel].copy(), 0.7, 20)
        assert differ_by(found[..., channel], single) == 0


def test_equalize_follows_the_cumulative_histogram(gray):
    found = equalize(gray, "BGR", Equalize.GLOBAL, 2, 8)
    assert differ_by(found, spread(gray)) <= 1


def test_equalize_spreads_a_narrow_range_over_the_whole(dtype):
    narrow = (np.arange(40, dtype=dtype) + dtype(100)).reshape(5, 8)
    found = equalize(narrow, "BGR", Equalize.GLOBAL, 2, 8)
    assert (found.min(), found.max()) == (0, np.iinfo(dtype).max)
    assert (np.diff(found.ravel().astype(int)) > 0).all()


def test_clahe_of_one_tile_without_limit_is_the_cumulative_histogram(dtype):
    top = np.iinfo(dtype).max
    gray = np.random.default_rng(4).integers(0, top + 1, (16, 16), dtype)
    up_to = np.array([(gray <= value).sum() for value in gray.ravel()]).reshape(gray.shape)
    found = equalize(gray, "BGR", Equalize.CLAHE, 0, 1)
    assert differ_by(found, np.rint(up_to / gray.size * top).astype(dtype)) <= 1


def test_clahe_limits_the_contrast(dtype):
    unit = np.iinfo(dtype).max // 255
    gray = np.random.default_rng(10).integers(100 * unit, 104 * unit, (512, 512), dtype)
    ranges = [np.ptp(equalize(gray, "BGR", Equalize.CLAHE, clip, 2)) for clip in (1, 4, 16, 0)]
    assert ranges == sorted(set(ranges))


def test_colour_is_equalized_in_its_luma(dtype):
    top = np.iinfo(dtype).max
    base = np.random.default_rng(5).integers(top // 3, top // 2, (20, 20), dtype)
    tinted = np.stack((base, base, base + dtype(top // 10)), axis=-1)
    for mode in (Equalize.GLOBAL, Equalize.CLAHE):
        luma = equalize(to_gray(tinted, "BGR"), "BGR", mode, 2, 2)
        found = equalize(tinted, "BGR", mode, 2, 2)
        inside = (found > 0).all(axis=-1) & (found < top).all(axis=-1)
        assert inside.any()
        off = np.abs(to_gray(found, "BGR").astype(float) - luma)[inside].max()
        assert off <= top / 255 * 1.5
        difference = found[inside].astype(float)
        assert np.abs(difference[:, 2] - difference[:, 0] - top // 10).max() <= top / 255 * 3


@pytest.mark.parametrize("mode", [Equalize.GLOBAL, Equalize.CLAHE])
def test_every_size(colored, gray, mode):
    assert equalize(colored, "RGB", mode, 2, 8).shape == colored.shape
    assert equalize(gray, "BGR", mode, 2, 8).dtype == gray.dtype


def test_off_is_the_same_array(gray):
    assert adjust(gray, 1, 0) is gray
    assert equalize(gray, "BGR", Equalize.OFF, 2, 8) is gray

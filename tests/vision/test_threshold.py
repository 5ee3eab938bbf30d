import numpy as np
import pytest
from by_definition import differ_by, gaussian, windows

from ros_visualise.vision.color import to_gray
from ros_visualise.vision.threshold import Threshold, threshold

FIXED = {
    Threshold.TRUNCATE: lambda x, t, top: np.minimum(x, t),
    Threshold.BINARY: lambda x, t, top: np.where(x > t, top, 0),
    Threshold.BINARY_INVERTED: lambda x, t, top: np.where(x > t, 0, top),
    Threshold.TO_ZERO: lambda x, t, top: np.where(x > t, x, 0),
    Threshold.TO_ZERO_INVERTED: lambda x, t, top: np.where(x > t, 0, x),
}
OTHERS = [Threshold.OTSU, Threshold.ADAPTIVE_MEAN, Threshold.ADAPTIVE_GAUSSIAN]


def apply(image, mode, level=128, size=11, offset=2):
    return threshold(image, "BGR", mode, level, size, offset)


@pytest.mark.parametrize("mode", FIXED)
@pytest.mark.parametrize("level", [0, 1, 128, 254, 255])
def test_fixed(gray, colored, mode, level):
    top = np.iinfo(gray.dtype).max
    for image in (gray, colored):
        image.flat[0] = level * (top // 255)  # a value that equals it counts as below
        expected = FIXED[mode](image, level * (top // 255), top).astype(image.dtype)
        assert differ_by(apply(image, mode, level), expected) == 0


def test_the_two_sides_partition_the_image(colored):
    one = apply(colored.copy(), Threshold.TO_ZERO)
    other = apply(colored.copy(), Threshold.TO_ZERO_INVERTED)
    assert differ_by(one + other, colored) == 0
    assert not (one.astype(bool) & other.astype(bool)).any()


def test_only_what_may_be_is_overwritten(gray):
    before = gray.copy()
    expected = np.minimum(gray, gray.dtype.type(128 * (np.iinfo(gray.dtype).max // 255)))
    assert differ_by(apply(gray, Threshold.TRUNCATE), expected) == 0
    assert differ_by(gray, before) == 0
    found = threshold(gray, "BGR", Threshold.TRUNCATE, 128, 11, 2, into=gray)
    assert differ_by(found, expected) == 0
    assert np.shares_memory(found, gray)


def otsu_by_definition(gray):
    """The value that splits the image into two classes of the largest variance between."""

    def between(value):
        below, above = gray[gray <= value], gray[gray > value]
        return below.size * above.size * (below.mean() - above.mean()) ** 2

    return max(np.unique(gray)[:-1], key=between)


def test_otsu(dtype):
    random = np.random.default_rng(6)
    unit = np.iinfo(dtype).max // 255
    dark, bright = random.normal(60, 15, 150), random.normal(170, 20, 100)
    gray = (np.concatenate((dark, bright)).clip(0, 255) * unit).astype(dtype).reshape(10, 25)
    expected = np.where(gray > otsu_by_definition(gray.astype(float)), np.iinfo(dtype).max, 0)
    assert differ_by(apply(gray, Threshold.OTSU), expected.astype(dtype)) == 0


@pytest.mark.parametrize("mode", [Threshold.ADAPTIVE_MEAN, Threshold.ADAPTIVE_GAUSSIAN])
@pytest.mark.parametrize(("size", "offset"), [(3, 2), (6, -10), (11, 0)])
def test_adaptive(dtype, mode, size, offset):
    top = np.iinfo(dtype).max
    gray = np.random.default_rng(7).integers(0, top + 1, (19, 13), dtype)
    size |= 1
    sigma = 0.3 * ((size - 1) * 0.5 - 1) + 0.8
    weights = np.full((size, size), 1 / size**2)
    if mode is Threshold.ADAPTIVE_GAUSSIAN:
        # the smallest Gaussian is a fixed one, 1 2 1, wherever no sigma is asked for
        line = np.array([0.25, 0.5, 0.25])
        weights = np.outer(line, line) if size == 3 else gaussian(size, sigma)
    mean = (windows(gray.astype(float), size, "edge") * weights).sum((2, 3))
    excess = gray - (mean - offset * (top // 255))
    found = apply(gray, mode, size=size, offset=offset)
    assert set(np.unique(found)) <= {0, top}
    clear = np.abs(excess) > (1 if dtype == np.uint8 else 0.05)  # OpenCV rounds the mean at 8 bits
    assert clear.mean() > 0.9
    assert np.array_equal((found == top)[clear], (excess > 0)[clear])


@pytest.mark.parametrize("mode", OTHERS)
def test_otsu_and_adaptive_make_gray_of_colour(colored, mode):
    found = apply(colored, mode)
    assert differ_by(found, apply(to_gray(colored, "BGR"), mode)) == 0
    assert found.shape == colored.shape[:2]


def test_off_is_the_same_array(gray):
    assert apply(gray, Threshold.OFF) is gray

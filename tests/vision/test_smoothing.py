import numpy as np
import pytest
from by_definition import differ_by, gaussian, windows

from ros_visualise.vision.smoothing import Blur, blur, sharpen, sigma_of


def gaussian_blur(gray, size, sigma):
    return (windows(gray.astype(float), size, "reflect") * gaussian(size, sigma)).sum((2, 3))


@pytest.fixture
def image(dtype):
    return np.random.default_rng(3).integers(0, np.iinfo(dtype).max + 1, (23, 17), dtype)


@pytest.mark.parametrize(("size", "sigma"), [(3, 0.7), (6, 1.5), (9, 2.0)])
def test_gaussian_is_the_weighted_mean(image, size, sigma):
    expected = gaussian_blur(image, size | 1, sigma)
    found = blur(image, Blur.GAUSSIAN, size, sigma, 50)
    tolerance = 1.5 if image.dtype == np.uint8 else 66  # OpenCV's fixed-point weights
    assert np.abs(found - expected).max() <= tolerance


@pytest.mark.parametrize("size", [3, 4, 5])
def test_median(image, size):
    expected = np.median(windows(image, size | 1, "edge"), axis=(2, 3)).astype(image.dtype)
    assert differ_by(blur(image, Blur.MEDIAN, size, 0, 50), expected) == 0


def test_large_median_has_256_levels_at_16_bits(image):
    unit = np.iinfo(image.dtype).max // 255
    levels = np.rint(image / unit)
    expected = np.median(windows(levels, 7, "edge"), axis=(2, 3)) * unit
    assert differ_by(blur(image, Blur.MEDIAN, 7, 0, 50), expected.astype(image.dtype)) == 0


def test_bilateral_weighs_by_distance_and_difference(image):
    unit = np.iinfo(image.dtype).max // 255
    around = windows(image.astype(float), 5, "reflect")
    y, x = np.mgrid[-2:3, -2:3]
    near = np.exp(-(x**2 + y**2) / (2 * 1.2**2)) * (x**2 + y**2 <= 4)
    like = np.exp(-((around - image[..., None, None]) ** 2) / (2 * (60 * unit) ** 2))
    expected = (around * near * like).sum((2, 3)) / (near * like).sum((2, 3))
    found = blur(image, Blur.BILATERAL, 5, 1.2, 60)
    assert found.dtype == image.dtype
    assert np.abs(found - expected).max() <= 1.5 * unit


def test_sigma_zero_goes_by_the_size(image):
    for mode in (Blur.GAUSSIAN, Blur.BILATERAL):
        by_size = blur(image, mode, 9, 0, 50)
        by_sigma = blur(image, mode, 9, sigma_of(9), 50)
        assert differ_by(by_size, by_sigma) <= np.iinfo(image.dtype).max // 500
    assert sigma_of(9) == pytest.approx(1.7)


@pytest.mark.parametrize("amount", [0.5, 2.0])
def test_sharpen_adds_the_difference_from_the_blur(image, amount):
    top = np.iinfo(image.dtype).max
    smooth = gaussian_blur(image, 9, 1.0)
    expected = (image + amount * (image - smooth)).clip(0, top)
    found = sharpen(image, amount, 1.0)
    assert np.abs(found - expected).max() <= (1 + amount) * 1.5 * top / 255
    inside = (expected > 0) & (expected < top)
    assert abs((found - expected)[inside].mean()) < 0.2 * top / 255


@pytest.mark.parametrize("mode", [Blur.GAUSSIAN, Blur.MEDIAN, Blur.BILATERAL])
def test_channels_and_sizes(colored, mode):
    for size in (3, 7, 31):
        assert blur(colored, mode, size, 0, 50).shape == colored.shape
        flat = np.full_like(colored, 77 * 257 % 65536 if colored.itemsize == 2 else 77)
        assert differ_by(blur(flat, mode, size, 0, 50), flat) == 0


def test_off_is_the_same_array(gray):
    assert blur(gray, Blur.OFF, 5, 0, 50) is gray
    assert sharpen(gray, 0, 1.5) is gray

"""What lessons explain, held against OpenCV or a closed formula, value by value."""

import cv2
import numpy as np
import pytest

from ros_visualise.lessons.methods import mosaic
from ros_visualise.lessons.methods.colors import to_gray, to_hsv
from ros_visualise.lessons.methods.quality import entropy, mean_square, psnr, quantize
from ros_visualise.lessons.methods.sobel import central_difference, direction, magnitude, sobel
from ros_visualise.lessons.methods.thresholds import between_classes, otsu, tone_curves
from ros_visualise.lessons.topics.noise import NoiseModel, add_noise


@pytest.fixture(scope="module")
def bgr(landscape) -> np.ndarray:
    return landscape


@pytest.fixture(scope="module")
def gray(bgr) -> np.ndarray:
    return cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY)


def test_gray_and_hsv_are_opencvs_bit_for_bit(bgr):
    random = np.random.default_rng(0).integers(0, 256, (200, 210, 3), np.uint8)
    corners = np.stack(np.meshgrid(*[np.r_[0:256:17]] * 3), axis=-1).reshape(-1, 1, 3)
    for picture in (bgr, random, corners.astype(np.uint8)):
        assert (to_gray(picture) == cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)).all()
        assert (to_hsv(picture) == cv2.cvtColor(picture, cv2.COLOR_BGR2HSV)).all()


def test_a_ramp_has_the_gradient_of_its_plane():
    x, y = np.meshgrid(np.arange(20), np.arange(30))
    for a, b in ((3, 4), (-3, 4), (0, -5), (5, 0)):
        dx, dy = sobel((100 + a * x + b * y).astype(np.uint16) if min(a, b) >= 0 else
                       (400 + a * x + b * y).astype(np.uint16), 3)  # fmt: skip
        inner = np.s_[1:-1, 1:-1]
        assert (dx[inner] == 8 * a).all()
        assert (dy[inner] == 8 * b).all()
        assert magnitude(dx, dy)[5, 5] == pytest.approx(8 * np.hypot(a, b))
        assert direction(dx, dy)[5, 5] == pytest.approx(np.degrees(np.arctan2(b, a)) % 360)


def test_the_slope_is_that_of_numpy_between_the_ends(gray):
    row = gray[7]
    slope = central_difference(row)
    assert (slope[1:-1] == np.gradient(row.astype(float))[1:-1]).all()
    assert slope[0] == (float(row[1]) - row[0]) / 2


@pytest.mark.parametrize("level", [0, 1, 77, 128, 254, 255])
def test_tone_curves_are_opencvs_thresholds(gray, level):
    kinds = {
        "binary": cv2.THRESH_BINARY,
        "binary inverted": cv2.THRESH_BINARY_INV,
        "truncate": cv2.THRESH_TRUNC,
        "to zero": cv2.THRESH_TOZERO,
        "to zero inverted": cv2.THRESH_TOZERO_INV,
    }
    curves = tone_curves(level)
    assert list(curves) == list(kinds)
    for name, kind in kinds.items():
        assert (curves[name][gray] == cv2.threshold(gray, level, 255, kind)[1]).all()


def test_otsus_threshold_is_opencvs_and_parts_the_variance(gray):
    random = np.random.default_rng(5)
    two = np.concatenate([random.normal(70, 12, 3000), random.normal(180, 20, 5000)])
    for picture in (gray, gray[:50], np.clip(two, 0, 255).astype(np.uint8).reshape(80, 100)):
        counts = np.bincount(picture.ravel(), minlength=256)
        theirs, _ = cv2.threshold(picture, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
        level = otsu(counts)
        assert level == theirs
        below, above = picture[picture <= level], picture[picture > level]
        within = (below.size * below.var() + above.size * above.var()) / picture.size
        assert between_classes(counts)[level] == pytest.approx(picture.var() - within)


def test_one_level_alone_has_nothing_to_part():
    assert otsu(np.bincount([9] * 50, minlength=256)) == 0


def test_bilinear_demosaicing_is_opencvs_bit_for_bit(bgr):
    noise = np.random.default_rng(2).integers(0, 256, (40, 52, 3), np.uint8)
    for truth in (bgr, noise):
        measured = mosaic.to_mosaic(truth)
        assert (mosaic.bilinear(measured) == mosaic.demosaic(measured, "bilinear")).all()
    red, green, blue = measured[::2, ::2], measured[::2, 1::2], measured[1::2, 1::2]
    for channel, part in ((2, red), (1, green), (0, blue)):
        places = {2: np.s_[::2, ::2], 1: np.s_[::2, 1::2], 0: np.s_[1::2, 1::2]}[channel]
        assert (part == truth[places][..., channel]).all()
        assert (mosaic.colored(measured)[places][..., channel] == part).all()


def test_edge_aware_demosaicing_takes_green_along_the_edge(bgr):
    measured = mosaic.to_mosaic(bgr)
    found = mosaic.demosaic(measured, "edge-aware")
    assert (found[2:-2, 2:-2, ::2] == mosaic.bilinear(measured)[2:-2, 2:-2, ::2]).all()
    m = measured.astype(int)
    left, right, up, down = m[2:-2, 1:-3], m[2:-2, 3:-1], m[1:-3, 2:-2], m[3:-1, 2:-2]
    across, along = (left + right + 1) // 2, (up + down + 1) // 2
    green = np.where(abs(left - right) > abs(up - down), along, across)
    is_green = mosaic.channel_map(*measured.shape)[2:-2, 2:-2] == 1
    assert (found[2:-2, 2:-2, 1] == np.where(is_green, m[2:-2, 2:-2], green)).all()


def test_quality_is_opencvs_and_the_formulas(gray):
    other = np.clip(gray.astype(int) + 5, 0, 255).astype(np.uint8)
    assert psnr(gray, other) == pytest.approx(cv2.PSNR(gray, other), abs=1e-4)
    assert mean_square(np.zeros((4, 4), np.uint8), np.full((4, 4), 3, np.uint8)) == 9
    assert psnr(gray, gray) == np.inf
    assert entropy(np.arange(256, dtype=np.uint8)) == 8
    assert entropy(np.full(9, 3, np.uint8)) == 0
    assert entropy(np.array([0, 255, 0, 255], np.uint8)) == 1


@pytest.mark.parametrize("bits", range(1, 9))
def test_k_bits_are_two_to_the_k_levels(bits):
    levels = np.unique(quantize(np.arange(256, dtype=np.uint8), bits))
    assert len(levels) == 2**bits
    assert (levels == np.rint(np.linspace(0, 255, 2**bits))).all()


def test_noise_is_as_strong_as_it_says():
    gray = np.full((300, 400), 120, np.uint8)
    gaussian = add_noise(gray, NoiseModel.GAUSSIAN, 12, 1).astype(float)
    assert gaussian.mean() == pytest.approx(120, abs=0.2)
    assert gaussian.std() == pytest.approx(12, rel=0.02)
    poisson = add_noise(gray, NoiseModel.POISSON, 20, 1).astype(float)
    assert poisson.std() == pytest.approx(20 * np.sqrt(120 / 255), rel=0.02)
    peppered = add_noise(gray, NoiseModel.SALT_AND_PEPPER, 10, 1)
    assert (peppered == 0).mean() == pytest.approx(0.05, rel=0.05)
    assert (peppered == 255).mean() == pytest.approx(0.05, rel=0.05)
    for model in NoiseModel:
        assert (add_noise(gray, model, 0, 1) == gray).all()
        assert (add_noise(gray, model, 9, 1) == add_noise(gray, model, 9, 1)).all()


def test_smoothing_leaves_of_white_noise_what_the_formula_says():
    noise = np.random.default_rng(0).normal(0, 1, (600, 600)).astype(np.float32)
    for sigma in (1.0, 2.0, 3.5):
        left = cv2.GaussianBlur(noise, (0, 0), sigma).std()
        assert left == pytest.approx(1 / (2 * sigma * np.sqrt(np.pi)), rel=0.03)

"""The steps of Canny's method give what OpenCV gives, bit for bit."""

from itertools import product

import cv2
import numpy as np
import pytest

from ros_visualise.lessons.methods import canny
from ros_visualise.lessons.methods.sobel import direction, sobel, sobel_kernels
from ros_visualise.vision.edges import smooth

APERTURES = (3, 5, 7)


@pytest.fixture(scope="module")
def pictures(landscape) -> list[np.ndarray]:
    random = np.random.default_rng(1)
    noise = random.integers(0, 256, (61, 47), np.uint8)
    drawn = cv2.cvtColor(landscape, cv2.COLOR_BGR2GRAY)
    steps = np.kron(random.integers(0, 2, (8, 9), np.uint8) * 255, np.ones((7, 7), np.uint8))
    flat = np.full((5, 4), 9, np.uint8)
    return [noise, drawn, smooth(drawn, 1.4), steps, flat, noise[:1], noise[:, :1]]


@pytest.mark.parametrize("aperture", APERTURES)
def test_derivatives_are_those_of_opencv(pictures, aperture):
    for gray in pictures:
        border = cv2.BORDER_REPLICATE
        dx, dy = sobel(gray, aperture)
        for ours, (x, y) in ((dx, (1, 0)), (dy, (0, 1))):
            theirs = cv2.Sobel(gray, cv2.CV_64F, x, y, ksize=aperture, borderType=border)
            assert (ours == theirs).all()
    across, along = cv2.getDerivKernels(0, 1, aperture)
    smoothing, deriving = sobel_kernels(aperture)
    assert (smoothing == across.ravel()).all()
    assert (deriving == along.ravel()).all()


@pytest.mark.parametrize(("aperture", "is_l2"), [*product(APERTURES, (False, True))])
def test_edges_are_those_of_opencv_bit_for_bit(pictures, aperture, is_l2):
    thresholds = [(50, 150), (300, 200), (0, 0), (33, 81), (600, 2500), (9000, 3000), (0, 40000)]
    for gray, (low, high) in product(pictures, thresholds):
        found = canny.gradient(gray, aperture, is_l2)
        edges = canny.hysteresis(found, canny.is_maximum(found), low, high)
        theirs = cv2.Canny(gray, low, high, apertureSize=aperture, L2gradient=is_l2)
        assert (edges.pixels == theirs).all()
        assert (canny.opencv_edges(found, low, high) == theirs).all()


def test_directions_have_the_nearest_of_four_classes():
    angles = np.radians(np.arange(0.3, 360, 0.7))
    dx, dy = (np.rint(1000 * f(angles)).astype(np.int64)[None] for f in (np.cos, np.sin))
    found = canny.Gradient(np.zeros(dx.shape, np.uint8), dx, dy, 3, True)
    nearest = np.rint(direction(dx, dy) / 45).astype(int) % 4
    assert (canny.direction_class(found) == nearest).all()
    for kind, (x, y) in enumerate(canny.NEIGHBOURS):
        assert round(np.degrees(np.arctan2(y, x))) == 45 * kind


def test_weak_edges_are_rescued_by_a_chain_that_begins_strong():
    gray = np.zeros((9, 40), np.uint8)
    gray[:, 20:] = np.linspace(10, 60, 9).astype(np.uint8)[:, None]
    gray[3:6, 5] = 12  # apart from it
    found = canny.gradient(gray, 3, is_l2=False)
    edges = canny.hysteresis(found, canny.is_maximum(found), 30, 150)
    line = (edges.strong | edges.rescued)[1:-1, 18:22].any(axis=1)
    assert line.all()
    assert edges.rescued.any()
    assert edges.lost[:, :10].any()
    assert not edges.pixels[:, :10].any()

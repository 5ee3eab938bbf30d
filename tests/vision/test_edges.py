import numpy as np
import pytest
from by_definition import differ_by, gaussian, windows

from ros_visualise.vision import edges
from ros_visualise.vision.edges import EdgeColor, Method

cv2 = pytest.importorskip("cv2")

SMOOTH = {3: [1, 2, 1], 5: [1, 4, 6, 4, 1], 7: [1, 6, 15, 20, 15, 6, 1]}
FIRST = {3: [-1, 0, 1], 5: [-1, -2, 0, 2, 1], 7: [-1, -4, -5, 0, 5, 4, 1]}
SECOND = {3: [1, -2, 1], 5: [1, 0, -2, 0, 1], 7: [1, 2, -1, -4, -1, 2, 1]}


def correlate(gray, kernel):
    return (windows(gray.astype(float), len(kernel), "edge") * kernel).sum((2, 3))


def magnitude(gray, aperture):
    dx = correlate(gray, np.outer(SMOOTH[aperture], FIRST[aperture]))
    dy = correlate(gray, np.outer(FIRST[aperture], SMOOTH[aperture]))
    return np.hypot(dx, dy)


def step(top=255):
    """A black and white image with its border between columns 7 and 8."""
    image = np.zeros((12, 16), np.uint16 if top > 255 else np.uint8)
    image[:, 8:] = top
    return image


@pytest.fixture
def scene():
    """Blobs with noise: edges of every direction and strength."""
    noise = np.random.default_rng(11).normal(0, 1, (80, 60))
    rough = cv2.GaussianBlur(noise, (0, 0), 3) * 500
    return (128 + rough + noise * 4).clip(0, 255).astype(np.uint8)


@pytest.mark.parametrize("aperture", [3, 5, 7])
def test_gradient_magnitude(gray, aperture):
    found = edges.gradient_magnitude(gray, aperture)
    np.testing.assert_allclose(found, magnitude(gray, aperture), rtol=1e-5, atol=1e-2)


@pytest.mark.parametrize("image", [step(), step().T.copy(), step(65535)])
def test_a_step_is_a_line_of_one_pixel_at_its_border(image):
    found = edges.canny(image, 200, 300)
    lines = (found > 0).sum(axis=1) if image.shape == (12, 16) else (found > 0).sum(axis=0)
    assert set(np.unique(found)) == {0, 255}
    assert (lines == 1).all()
    there = np.unique(np.nonzero(found)[1 if image.shape == (12, 16) else 0])
    assert set(there) <= {7, 8}
    assert len(there) == 1


def test_a_plain_image_has_no_edges(gray):
    plain = np.full_like(gray, 99)
    for automatic in (False, True):
        assert not edges.canny(plain, 0, 0, automatic=automatic).any()


@pytest.mark.parametrize("aperture", [3, 5, 7])
@pytest.mark.parametrize("l2_gradient", [False, True])
def test_canny_is_that_of_opencv(scene, aperture, l2_gradient):
    expected = cv2.Canny(scene, 100, 200, apertureSize=aperture, L2gradient=l2_gradient)
    found = edges.canny(scene, 100, 200, aperture, l2_gradient=l2_gradient)
    assert expected.any()
    assert differ_by(found, expected) == 0


def test_swapped_thresholds_are_the_same(scene):
    assert differ_by(edges.canny(scene, 200, 100), edges.canny(scene, 100, 200)) == 0


def test_hysteresis_lies_between_its_two_thresholds(scene):
    few, some, many = (edges.canny(scene, *t) > 0 for t in ((200, 200), (100, 200), (100, 100)))
    assert (few <= some).all()
    assert (some <= many).all()
    assert few.sum() < some.sum() < many.sum()


def test_16_bits_give_the_edges_of_8(scene):
    wide = scene.astype(np.uint16) * np.uint16(257)
    assert differ_by(edges.canny(wide, 100, 200), edges.canny(scene, 100, 200)) == 0


@pytest.mark.parametrize("aperture", [3, 5])
@pytest.mark.parametrize("minimum", [120, 200, 790])
def test_min_gradient_keeps_what_exceeds_it(scene, aperture, minimum):
    every = edges.canny(scene, 100, 150, aperture)
    kept = edges.canny(scene, 100, 150, aperture, min_gradient=minimum)
    assert differ_by(kept, np.where(magnitude(scene, aperture) > minimum, every, np.uint8(0))) == 0


def test_min_gradient_itself_does_not_exceed_it():
    assert not edges.canny(step(100), 200, 300, min_gradient=400).any()
    assert edges.canny(step(100), 200, 300, min_gradient=399).any()


def test_automatic_thresholds_separate_two_strengths():
    strength = np.array([[10, 11, 12, 13] * 6, [200, 210, 220, 230] * 6], np.float32)
    low, high = edges.automatic_thresholds(strength)
    assert 13 <= low + 230 / 255 < 200
    assert high == 2 * low


def test_automatic_edges_go_by_the_euclidean_norm(scene):
    low, high = edges.automatic_thresholds(edges.gradient_magnitude(scene, 3))
    expected = cv2.Canny(scene, low, high, L2gradient=True)
    assert differ_by(edges.canny(scene, 0, 0, automatic=True), expected) == 0


def test_automatic_thresholds_follow_the_contrast(scene):
    faint = (scene // 4).astype(np.uint8)
    sure = edges.canny(scene, 0, 0, automatic=True) > 0
    found = edges.canny(faint, 0, 0, automatic=True) > 0
    assert sure.any()
    assert 0.5 < found.sum() / sure.sum() < 2
    assert not edges.canny(faint, 200, 300).any()


@pytest.mark.parametrize("aperture", [3, 5, 7])
@pytest.mark.parametrize("method", [Method.SOBEL, Method.SCHARR, Method.LAPLACIAN])
def test_every_strength_is_on_the_scale_of_a_step(method, aperture):
    for top in (255, 65535):
        found = edges.derivative(step(top), method, aperture, 0)
        assert found.max() == pytest.approx(1020)
        assert not found[:, :4].any()


def test_sobel(gray):
    unit = np.iinfo(gray.dtype).max // 255
    for aperture, gain in ((3, 1), (5, 12), (7, 160)):
        expected = magnitude(gray, aperture) / gain / unit
        found = edges.derivative(gray, Method.SOBEL, aperture, 0)
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-3)


def test_scharr(gray):
    unit = np.iinfo(gray.dtype).max // 255
    kernel = np.outer([3, 10, 3], [-1, 0, 1])
    expected = np.hypot(correlate(gray, kernel), correlate(gray, kernel.T)) / 4 / unit
    found = edges.derivative(gray, Method.SCHARR, 3, 0)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-3)


def test_laplacian(gray):
    unit = np.iinfo(gray.dtype).max // 255
    for aperture, gain in ((3, 1), (5, 4), (7, 48)):
        kernel = np.outer(SMOOTH[aperture], SECOND[aperture])
        expected = np.abs(correlate(gray, kernel + kernel.T)) / gain / unit
        found = edges.derivative(gray, Method.LAPLACIAN, aperture, 0)
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-2)


def test_laplacian_of_gaussian(scene):
    weights = gaussian(17, 1.5)
    blurred = (windows(scene.astype(float), 17, "reflect") * weights).sum((2, 3))
    kernel = np.outer(SMOOTH[3], SECOND[3])
    expected = np.abs(correlate(blurred, kernel + kernel.T)) * 1.5**2
    found = edges.derivative(scene, Method.LAPLACIAN, 3, 1.5)
    np.testing.assert_allclose(found, expected, atol=0.05 * expected.max())


@pytest.mark.parametrize("method", [Method.SOBEL, Method.SCHARR, Method.LAPLACIAN])
def test_more_blur_leaves_the_strength_of_a_step(method):
    wide = np.repeat(step(), 4, axis=1)
    one, two, three = (edges.derivative(wide, method, 3, sigma).max() for sigma in (1, 2, 3))
    assert one == pytest.approx(three, rel=0.25)
    assert two == pytest.approx(three, rel=0.1)


STRENGTH = np.array([[0, 100, 150, 200, 300, 900]], np.float32)


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({"low": 100, "high": 200}, [0, 0, 127.5, 255, 255, 255]),
        ({"low": 200, "high": 100}, [0, 0, 127.5, 255, 255, 255]),
        ({"low": 150, "high": 150}, [0, 0, 0, 255, 255, 255]),
        ({"low": 0, "high": 0}, [0, 255, 255, 255, 255, 255]),
        ({"low": 0, "high": 600, "min_gradient": 200}, [0, 0, 0, 0, 127.5, 255]),
    ],
)
def test_levels(settings, expected):
    found = edges.to_levels(STRENGTH, **settings)
    assert found.dtype == np.uint8
    assert np.abs(found - expected).max() <= 0.5


def test_levels_of_every_size(gray):
    for method in (Method.SOBEL, Method.SCHARR, Method.LAPLACIAN):
        strength = edges.derivative(gray, method, 7, 1.5)
        low, high = edges.automatic_thresholds(strength)
        found = edges.to_levels(strength, 0, 0, automatic=True)
        assert differ_by(found, edges.to_levels(strength, low, high)) == 0
        assert found.shape == gray.shape


def test_smooth(dtype):
    image = np.random.default_rng(12).integers(0, np.iinfo(dtype).max + 1, (20, 15), dtype)
    expected = (windows(image.astype(float), 9, "reflect") * gaussian(9, 1.2)).sum((2, 3))
    assert np.abs(edges.smooth(image, 1.2) - expected).max() <= np.iinfo(dtype).max / 255 * 2
    assert edges.smooth(image, 0) is image


@pytest.mark.parametrize(
    ("color", "bgr"),
    [
        ("red", (0, 0, 255)),
        ("green", (0, 255, 0)),
        ("blue", (255, 0, 0)),
        ("yellow", (0, 255, 255)),
        ("magenta", (255, 0, 255)),
        ("cyan", (255, 255, 0)),
        ("white", (255, 255, 255)),
        ("black", (0, 0, 0)),
    ],
)
def test_overlay_has_the_colour_on_edges_and_the_image_elsewhere(colored, color, bgr):
    eight = np.rint(colored / (np.iinfo(colored.dtype).max // 255)).astype(np.uint8)
    drawn = np.zeros(colored.shape[:2], np.uint8)
    drawn.flat[::3] = 255
    expected = np.where(drawn[..., None] > 0, np.uint8(bgr), eight)
    assert differ_by(edges.draw_over(colored, "BGR", drawn, EdgeColor(color)), expected) == 0
    rgb = colored[..., ::-1].copy()
    assert differ_by(edges.draw_over(rgb, "RGB", drawn, EdgeColor(color)), expected) == 0


def test_overlay_of_gray_with_a_faint_edge():
    gray = np.full((1, 2), 100, np.uint8)
    faint = np.array([[0, 60]], np.uint8)
    found = edges.draw_over(gray, "BGR", faint, EdgeColor.YELLOW)
    assert found.tolist() == [[[100, 100, 100], [40, 160, 160]]]


@pytest.mark.parametrize("name", ["100007", "100039"])
def test_automatic_edges_of_photographs_are_neither_few_nor_most(recordings, name):
    gray = cv2.imread(str(recordings / "edges" / "images" / f"{name}.jpg"), cv2.IMREAD_GRAYSCALE)
    found = edges.canny(edges.smooth(gray, 1.4), 0, 0, automatic=True)
    assert 0.01 < (found > 0).mean() < 0.1

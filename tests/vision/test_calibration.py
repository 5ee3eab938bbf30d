import numpy as np
import pytest

from ros_visualise.data import CameraInfo
from ros_visualise.vision.reshape import flipped, resized

cv2 = pytest.importorskip("cv2")

SIZE = (640, 480)
K = np.array([[536.0, 0, 342.3], [0, 541.0, 235.6], [0, 0, 1]])
DISTORTIONS = {
    "none": [],
    "four": [-0.26, 0.08, 0.004, -0.003],
    "plumb_bob": [-0.26, 0.08, 0.004, -0.003, 0.01],
    "rational": [0.3, -0.1, 0.004, -0.003, 0.01, 0.4, -0.05, 0.02],
    "thin_prism": [0.3, -0.1, 0.004, -0.003, 0.01, 0.4, -0.05, 0.02, 0.01, -0.02, 0.03, 0.01],
    "tilted": [-0.2, 0.1, 0.004, -0.003, 0.01, 0.1, 0.0, 0.0, 0.01, -0.02, 0.03, 0.01, 0.05, -0.08],
}
FLIPS = [(True, False), (False, True), (True, True)]


@pytest.fixture
def points():
    random = np.random.default_rng(9)
    return np.column_stack((random.uniform(-1, 1, (50, 2)), random.uniform(2, 5, 50)))


@pytest.fixture(params=DISTORTIONS)
def info(request):
    turn, _ = cv2.Rodrigues(np.array([0.05, -0.1, 0.02]))
    projection = np.array([[500.0, 0, 330, -60], [0, 500, 240, 15], [0, 0, 1, 0]])
    distortion = np.array(DISTORTIONS[request.param], dtype=float)
    return CameraInfo(SIZE[1], SIZE[0], K, distortion, turn, projection)


def seen(info, points):
    """Where the camera sees points of its frame."""
    pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), info.K, info.D)
    return pixels.reshape(-1, 2)


def rectified(info, points):
    """Where the rectified image has them."""
    homogeneous = np.column_stack((points @ info.R.T, np.ones(len(points))))
    pixels = homogeneous @ info.P.T
    return pixels[:, :2] / pixels[:, 2:]


@pytest.mark.parametrize("after", [(320, 240), (1280, 480), (101, 67), (1, 1)])
@pytest.mark.parametrize("project", [seen, rectified])
def test_projecting_then_resizing_is_projecting_with_the_resized(info, points, after, project):
    new = resized(info, SIZE, after)
    expected = (project(info, points) + 0.5) * np.divide(after, SIZE) - 0.5
    np.testing.assert_allclose(project(new, points), expected, atol=1e-6)
    assert (new.width, new.height) == after


@pytest.mark.parametrize(("horizontal", "vertical"), FLIPS)
@pytest.mark.parametrize("project", [seen, rectified])
def test_projecting_then_flipping_is_projecting_the_mirrored_world(
    info, points, horizontal, vertical, project
):
    new = flipped(info, SIZE, horizontal=horizontal, vertical=vertical)
    mirror = [-1 if horizontal else 1, -1 if vertical else 1, 1]
    expected = project(info, points)
    if horizontal:
        expected[:, 0] = SIZE[0] - 1 - expected[:, 0]
    if vertical:
        expected[:, 1] = SIZE[1] - 1 - expected[:, 1]
    np.testing.assert_allclose(project(new, points * mirror), expected, atol=1e-6)
    assert (new.K.diagonal() > 0).all()


@pytest.mark.parametrize(("horizontal", "vertical"), FLIPS)
def test_flipping_twice_is_the_calibration_itself(info, horizontal, vertical):
    ways = {"horizontal": horizontal, "vertical": vertical}
    twice = flipped(flipped(info, SIZE, **ways), SIZE, **ways)
    for name in ("K", "D", "R", "P"):
        np.testing.assert_allclose(getattr(twice, name), getattr(info, name), atol=1e-12)


def test_fisheye_coefficients_are_radial_and_stay():
    info = CameraInfo(480, 640, K, np.array([0.1, 0.2, 0.3, 0.4]), distortion_model="equidistant")
    assert flipped(info, SIZE, horizontal=True, vertical=True).D.tolist() == [0.1, 0.2, 0.3, 0.4]


def test_without_a_projection_matrix_there_is_none_after():
    info = CameraInfo(480, 640, K)
    assert resized(info, SIZE, (10, 10)).P is None
    assert flipped(info, SIZE, horizontal=True, vertical=False).P is None

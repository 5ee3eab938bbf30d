"""Rectified images show points where P has them, whatever the camera's lens does."""

from dataclasses import replace

import numpy as np
import pytest

from ros_visualise.core.errors import UnsupportedImage
from ros_visualise.data import CameraInfo
from ros_visualise.vision.rectification import Interpolation, model_of, rectified, rectify

cv2 = pytest.importorskip("cv2")

SIZE = (320, 240)
K = np.array([[250.0, 0, 161.3], [0, 255.0, 118.2], [0, 0, 1]])
P = np.array([[230.0, 0, 158, -20], [0, 231.0, 121, 0], [0, 0, 1, 0]])
TURN, _ = cv2.Rodrigues(np.array([0.03, -0.05, 0.02]))
MODELS = {
    "plumb_bob": [-0.26, 0.08, 0.004, -0.003, 0.01],
    "rational_polynomial": [0.3, -0.1, 0.004, -0.003, 0.01, 0.4, -0.05, 0.02],
    "equidistant": [0.1, -0.02, 0.01, 0.003],
}
SEEN = np.array([[0.1, -0.2, 2.0], [-0.4, 0.3, 2.0], [0.5, 0.35, 2.0], [0.0, 0.0, 2.0]])


@pytest.fixture(params=MODELS)
def info(request):
    D = np.array(MODELS[request.param])
    return CameraInfo(SIZE[1], SIZE[0], K, D, TURN, P, request.param)


def photograph(info, points):
    """What the camera sees of points: bright spots, their middle to a tenth of a pixel."""
    if info.distortion_model == "equidistant":
        zero = np.zeros((3, 1))
        at, _ = cv2.fisheye.projectPoints(points[:, None], zero, zero, info.K, info.D)
    else:
        at, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), info.K, info.D)
    return at.reshape(-1, 2), spots(at.reshape(-1, 2))


def spots(middles):
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    far = [(x - u) ** 2 + (y - v) ** 2 for u, v in middles]
    return np.rint(sum(255 * np.exp(-one / 18) for one in far)).clip(0, 255).astype(np.uint8)


def found(image, near):
    """The middle of the spot around a place."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    weight = np.where(np.hypot(x - near[0], y - near[1]) < 9, image.astype(float), 0)
    return np.array([(weight * x).sum(), (weight * y).sum()]) / weight.sum()


def projected(info, points):
    """Where a camera without distortion sees points of its own frame."""
    homogeneous = points @ info.K.T
    return homogeneous[:, :2] / homogeneous[:, 2:]


@pytest.mark.parametrize("alpha", [-1.0, 0.0, 0.5, 1.0])
def test_points_are_where_the_new_calibration_has_them(info, alpha):
    _, image = photograph(info, SEEN)
    model = model_of(info, alpha)
    after = rectified(info, model)
    image = rectify(image, model, Interpolation.LINEAR)
    seen = SEEN @ model.R.T  # the frame of the rectified camera
    for expected in projected(after, seen):
        np.testing.assert_allclose(found(image, expected), expected, atol=0.15)
    assert not after.D.any()
    np.testing.assert_array_equal(after.R, np.eye(3))
    np.testing.assert_array_equal(after.K, after.P[:, :3])
    assert (after.width, after.height, after.header) == (*SIZE, info.header)


def test_as_calibrated_it_is_laid_out_by_p(info):
    np.testing.assert_array_equal(rectified(info, model_of(info, -1)).P, P)


def test_alpha_chooses_between_valid_pixels_and_all(info):
    white = np.full(SIZE[::-1], 255, np.uint8)
    areas = [
        (rectify(white, model_of(info, alpha), Interpolation.LINEAR) == 255).mean()
        for alpha in (0.0, 1.0)
    ]
    assert areas[0] > 0.98
    assert areas[1] < areas[0]


def test_what_the_camera_did_not_see_is_black_or_no_number():
    info = CameraInfo(*SIZE[::-1], K, np.array(MODELS["plumb_bob"]))
    model = model_of(info, 1.0)
    assert rectify(np.ones(SIZE[::-1], np.uint8), model, Interpolation.NEAREST)[0, 0] == 0
    assert np.isnan(rectify(np.ones(SIZE[::-1], np.float32), model, Interpolation.NEAREST)[0, 0])


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "int16", "float32", "float64"])
@pytest.mark.parametrize("channels", [(), (2,), (3,), (4,)])
@pytest.mark.parametrize("interpolation", Interpolation)
def test_every_type_of_pixels_keeps_its_shape(dtype, channels, interpolation):
    info = CameraInfo(*SIZE[::-1], K, np.array(MODELS["plumb_bob"]))
    pixels = np.full((*SIZE[::-1], *channels), 7, dtype)
    image = rectify(pixels, model_of(info, -1), interpolation)
    assert (image.shape, image.dtype) == (pixels.shape, pixels.dtype)
    np.testing.assert_array_equal(image[120, 160], pixels[120, 160])


def test_a_camera_without_distortion_gives_the_pixels_themselves():
    pixels = np.ones(SIZE[::-1], np.uint8)
    for ideal in (
        CameraInfo(*SIZE[::-1], K),
        CameraInfo(*SIZE[::-1], K, np.zeros(0), np.zeros((3, 3)), np.zeros((3, 4)), ""),
    ):
        model = model_of(ideal, -1)
        assert rectify(pixels, model, Interpolation.LINEAR) is pixels
        np.testing.assert_array_equal(rectified(ideal, model).K, K)


def test_a_fisheye_without_coefficients_is_still_one():
    info = CameraInfo(*SIZE[::-1], K, np.zeros(4), distortion_model="equidistant")
    image = spots([(300, 220)])
    assert (rectify(image, model_of(info, -1), Interpolation.LINEAR) != image).any()


@pytest.mark.parametrize(
    ("model", "D", "expected"),
    [
        (
            "fov",
            [0.9],
            "unsupported distortion_model 'fov'; use one of plumb_bob, rational_polynomial, equi",
        ),
        ("plumb_bob", [0.1, 0.2], "has 2 coefficients of plumb_bob, which needs 0 or 4 or 5"),
        ("equidistant", [0.1] * 5, "has 5 coefficients of equidistant, which needs 4"),
    ],
)
def test_what_nobody_can_undo_is_refused(model, D, expected):
    info = CameraInfo(*SIZE[::-1], K, np.array(D), distortion_model=model)
    with pytest.raises(UnsupportedImage, match=expected):
        model_of(info, -1)


def test_types_that_opencv_cannot_rectify_are_refused():
    info = CameraInfo(*SIZE[::-1], K, np.array(MODELS["plumb_bob"]))
    with pytest.raises(UnsupportedImage, match="images of type int32 cannot be rectified"):
        rectify(np.ones(SIZE[::-1], np.int32), model_of(info, -1), Interpolation.LINEAR)


def test_a_changed_calibration_is_followed(info):
    _, image = photograph(info, SEEN)
    shifted = replace(info, P=P + np.array([[0, 0, 5.0, 0], [0] * 4, [0] * 4]))
    before, after = (
        rectify(image, model_of(one, -1), Interpolation.NEAREST) for one in (info, shifted)
    )
    np.testing.assert_array_equal(after[:, 5:], before[:, :-5])

"""The lesson on vision: what it says of the network's first layer, held against onnxruntime."""

import cv2
import numpy as np
import onnx
import onnxruntime
import pytest

from ros_visualise.landmarks.networks.network import Network
from ros_visualise.lessons.methods import layer as ours
from ros_visualise.lessons.methods.sobel import sobel
from ros_visualise.nodes.landmark_detector import OWN_MODEL

GX = np.array([[-1, 0, 1], [-2, 0, 2], [-1, 0, 1]], np.float32)


def kernel(red, green, blue):
    return np.stack([red, green, blue])[None].astype(np.float32)


@pytest.fixture(scope="module")
def layer() -> ours.Layer:
    return ours.first_layer(Network(str(OWN_MODEL)).metadata)


@pytest.fixture(scope="module")
def random_bgr() -> np.ndarray:
    return np.random.default_rng(4).integers(0, 256, (64, 128, 3), np.uint8)


def test_activations_are_those_of_the_network_itself(layer, random_bgr):
    model = onnx.load(str(OWN_MODEL))
    first = next(one for one in model.graph.node if one.op_type == "Relu").output[0]
    told = onnx.helper.make_tensor_value_info(first, onnx.TensorProto.FLOAT, None)
    model.graph.output.append(told)
    session = onnxruntime.InferenceSession(
        model.SerializeToString(), providers=["CPUExecutionProvider"]
    )
    rgb = random_bgr[..., ::-1].transpose(2, 0, 1)[None].astype(np.float32) / 255
    (theirs,) = session.run([first], {"images": rgb})
    assert theirs.max() > 1
    assert ours.relu(ours.respond(random_bgr, layer)) == pytest.approx(theirs[0], abs=1e-5)


def test_a_layer_of_sobels_kernels_answers_as_sobel(random_bgr):
    of_gray = [weight * GX for weight in (0.299, 0.587, 0.114)]
    mine = ours.respond(random_bgr, ours.Layer(kernel(*of_gray), np.array([0.25], np.float32)))[0]
    gray = random_bgr.astype(float) @ (0.114, 0.587, 0.299)
    theirs = cv2.Sobel(gray, cv2.CV_64F, 1, 0, ksize=3)[::2, ::2] / 255 + 0.25
    assert mine[1:, 1:] == pytest.approx(theirs[1:, 1:], abs=1e-5)
    dx, _ = sobel(cv2.cvtColor(random_bgr, cv2.COLOR_BGR2GRAY), 3)
    assert ours.correlation(ours.beside(dx)[1:, 1:], mine[1:, 1:]) > 0.999


@pytest.mark.parametrize("shape", [(1, 1, 3), (5, 8, 3), (6, 7, 3)])
def test_every_second_pixel_is_answered(shape, layer):
    pixels = np.zeros(shape, np.uint8)
    answers = ours.respond(pixels, layer)
    assert answers.shape[1:] == ours.beside(pixels).shape[:2]


def test_likeness_is_the_cosine_with_each_kind():
    flat, centre = np.ones((3, 3)), np.diag([0, 1, 0])
    cases = {
        (1, 0, 0): kernel(GX, GX, GX),
        (0, 1, 0): kernel(*[flat - 9 * centre] * 3),
        (0, 0, 1): kernel(GX, -GX, 0 * GX),
        (0.6, 0.8, 0): kernel(*[3 * GX / np.linalg.norm(GX) + 4 * flat / 3] * 3),
    }
    for cosines, one in cases.items():
        assert ours.likeness(one)[0] == pytest.approx(cosines, abs=1e-6)
    turned = kernel(*[np.cos(1) * GX - np.sin(1) * GX.T] * 3)
    assert ours.sobel_cosines(turned)[0] == pytest.approx((np.cos(1), -np.sin(1)), abs=1e-6)
    chance = np.random.default_rng(1).normal(size=(500, 3, 3, 3))
    squares = (ours.likeness(chance) ** 2).sum(axis=1)
    assert (squares <= 1).all()
    # 2, 2 and 18 of 27 numbers
    assert (ours.likeness(chance) ** 2).mean(axis=0) == pytest.approx(
        [2 / 27, 2 / 27, 18 / 27], abs=0.01
    )


def test_the_correlation_is_numpys(random_bgr):
    one, other = random_bgr[..., 0], random_bgr[..., 1] // 2 + random_bgr[..., 0] // 3
    assert ours.correlation(one, other) == pytest.approx(
        np.corrcoef(one.ravel(), other.ravel())[0, 1]
    )
    assert ours.correlation(one, np.full_like(one, 7)) == 0

"""Each layout, by a network that finds a bright spot: place, colours, class, score."""

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

pytest.importorskip("cv2")
pytest.importorskip("onnxruntime", reason="pip install 'ros_visualise[detect]' to run this")
made = pytest.importorskip("made_networks")

from ros_visualise.landmarks.networks import layouts  # noqa: E402
from ros_visualise.landmarks.networks.candidates import SelectionRules  # noqa: E402
from ros_visualise.landmarks.networks.network import Network  # noqa: E402

NAMES = sorted(made.MAKERS)
BGR_NETWORKS = ("YOLOX", "NanoDet-Plus")
STRETCHED = ("RT-DETRv2/D-FINE/DEIM", "Ultralytics RT-DETR", "RF-DETR", "NanoDet-Plus")


def find(network, pixels, order="BGR", **choice):
    return network.detect(pixels, order, SelectionRules(**choice))


def only(found):
    assert len(found) == 1
    (box,) = found.boxes_xyxy
    return (box[:2] + box[2:]) / 2, box[2:] - box[:2]


def spot(width, height, column, row, channel=slice(None)):
    pixels = np.full((height, width, 3), 40, np.uint8)
    pixels[row, column, channel] = 255
    return pixels


def test_every_layout_is_here():
    assert {layout.name for layout in layouts.ALL} == set(made.MAKERS)


@pytest.mark.parametrize("name", NAMES)
def test_at_its_own_size_a_pixel_is_where_it_is(name, tmp_path):
    network = Network(made.MAKERS[name](tmp_path / "n.onnx", 128, 96))
    assert network.layout.name == name
    found = find(network, spot(128, 96, 71, 30))
    center, size = only(found)
    assert center == pytest.approx([71, 30], abs=1e-3)
    assert size == pytest.approx(made.SIZE, abs=1e-3)
    assert found.classes.tolist() == [made.CLASS]
    assert found.scores == pytest.approx([made.SCORE], abs=1e-5)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("order", ["BGR", "RGB"])
def test_its_first_channel_is_the_colour_that_it_was_trained_with(name, order, tmp_path):
    network = Network(made.MAKERS[name](tmp_path / "n.onnx", 128, 96))
    pixels = spot(128, 96, 20, 50, 0)  # the first colour of the image's order
    pixels[70, 100, 2] = 255  # and its third
    wanted = "BGR" if name in BGR_NETWORKS else "RGB"
    center, _ = only(find(network, pixels, order))
    assert center == pytest.approx([20, 50] if order == wanted else [100, 70], abs=1e-3)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("width", "height"), [(43, 32), (32, 43), (43, 29), (61, 17)])
def test_boxes_of_enlarged_images_are_exact(name, width, height, tmp_path):
    """The spot's pixel becomes one of several, whose brightest lies where the formula says."""
    network = Network(made.MAKERS[name](tmp_path / "n.onnx", 128, 96))
    column, row = width // 3, height // 2
    center, size = only(find(network, spot(width, height, column, row)))
    gain = np.array([128 / width, 96 / height])
    offset = np.zeros(2)
    if name not in STRETCHED:
        scale = gain.min()
        inside = np.array([round(width * scale), round(height * scale)])
        gain = inside / (width, height)
        if name != "YOLOX":
            offset = (np.array([128, 96]) - inside) // 2
    assert size == pytest.approx(made.SIZE / gain, abs=1e-3)
    in_network = gain * (center + 0.5) + offset
    assert in_network % 1 == pytest.approx([0.5, 0.5], abs=1e-3)  # a pixel's centre there
    shift = (0.5 / gain - 0.5) if name == "NanoDet-Plus" else 0
    assert (np.abs(center - shift - [column, row]) <= 0.5 / gain + 1e-6).all()  # the nearest one


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("factor", [3, 5])
def test_made_smaller_by_an_odd_factor_a_block_keeps_its_centre(name, factor, tmp_path):
    network = Network(made.MAKERS[name](tmp_path / "n.onnx", 128, 96))
    column, row = 40 * factor, 25 * factor
    pixels = np.full((96 * factor, 128 * factor, 3), 40, np.uint8)
    pixels[row : row + factor, column : column + factor] = 255
    center, size = only(find(network, pixels))
    middle = (factor - 1) / 2
    if name == "NanoDet-Plus":  # there the first pixels' centres lie on one another, not the edges
        assert center == pytest.approx([column + middle, row + middle], abs=middle + 1e-3)
    else:
        assert center == pytest.approx([column + middle, row + middle], abs=1e-3)
    assert size == pytest.approx(np.array(made.SIZE) * factor, abs=1e-3)


def test_own_networks_tell_ground_points_in_pixels_of_the_image(tmp_path):
    """In an image half as large as the network's, so are distances; variances are a quarter."""
    network = Network(made.own(tmp_path / "n.onnx", 128, 96))
    found = find(network, spot(64, 48, 20, 30))
    center, _ = only(found)
    assert found.points_uv[0] - center == pytest.approx(np.array(made.POINT) / 2, abs=1e-4)
    want = np.diag(made.VARIANCES) / 4
    np.testing.assert_allclose(found.covariances, [want], atol=1e-5)


@pytest.mark.parametrize(("shape", "told"), [([1], 0.1), ([], 0.0)])
def test_a_network_that_may_be_told_the_least_score_is_told(shape, told, tmp_path):
    """This one adds it to its own scores; one of another shape is something else."""
    path = made.own(tmp_path / "n.onnx", 128, 96)
    model = onnx.load(path)
    graph = model.graph
    (scores,) = (node for node in graph.node if node.output[0] == "scores")
    scores.CopyFrom(helper.make_node("Add", [scores.input[0], "min_score"], ["scores"]))
    graph.initializer.append(numpy_helper.from_array(np.zeros(shape, np.float32), "min_score"))
    graph.input.append(helper.make_tensor_value_info("min_score", TensorProto.FLOAT, shape))
    onnx.save(model, path)
    found = find(Network(path), spot(128, 96, 20, 30), min_score=0.1)
    assert found.scores == pytest.approx([made.SCORE + told])


@pytest.mark.parametrize("name", NAMES)
def test_it_takes_half_precision(name, tmp_path):
    network = Network(made.MAKERS[name](tmp_path / "n.onnx", 128, 96, half=True))
    center, _ = only(find(network, spot(128, 96, 40, 60)))
    assert center == pytest.approx([40, 60], abs=0.1)  # half a float has 11 bits


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("kind", ["gray", "gray16", "alpha", "deep", "deep alpha"])
def test_it_takes_every_kind_of_image(name, kind, tmp_path):
    network = Network(made.MAKERS[name](tmp_path / "n.onnx", 128, 96))
    pixels = spot(128, 96, 90, 12)
    if "alpha" in kind:
        alpha = np.zeros((96, 128), np.uint8)
        alpha[5, 5] = 255
        pixels = np.dstack([pixels, alpha])
    if "gray" in kind:
        pixels = np.ascontiguousarray(pixels[..., 0])
    if "deep" in kind or "16" in kind:
        pixels = pixels.astype(np.uint16) * 257
    center, _ = only(find(network, pixels))
    assert center == pytest.approx([90, 12], abs=1e-3)


def test_where_the_size_is_free_the_image_gets_no_more_gray_than_needed(tmp_path):
    network = Network(made.yolo_10(tmp_path / "n.onnx", 0, 0, free=True), longest=320)
    for width, height in ((640, 480), (321, 123), (100, 300)):
        at = [width // 3, height // 3]
        pixels = np.full((height, width, 3), 40, np.uint8)
        pixels[at[1] - 2 : at[1] + 3, at[0] - 2 : at[0] + 3] = 255
        center, _ = only(find(network, pixels))
        assert center == pytest.approx(at, abs=2)
        assert network._blob.shape[2] % 32 == network._blob.shape[3] % 32 == 0
        assert max(network._blob.shape[2:]) == 320
    assert network._blob.shape == (1, 3, 320, 128)


def test_a_free_size_is_made_of_the_cells_of_the_file(tmp_path):
    path = made.yolo_10(tmp_path / "n.onnx", 0, 0, free=True, imgsz="[320, 320]", stride="64")
    network = Network(path)
    find(network, spot(640, 400, 10, 10))
    assert network._blob.shape == (1, 3, 256, 320)


def test_a_free_size_is_that_of_the_file(tmp_path):
    network = Network(made.yolo_10(tmp_path / "n.onnx", 0, 0, free=True, imgsz="[256, 192]"))
    find(network, spot(512, 512, 10, 10))
    assert network._blob.shape == (1, 3, 256, 256)
    assert Network(made.yolo_10(tmp_path / "m.onnx", 0, 0, free=True))._longest == 640


@pytest.mark.parametrize(
    ("metadata", "layout"),
    [
        ({}, "YOLOv10/YOLO26"),
        ({"description": "Ultralytics YOLO26n model"}, "YOLOv10/YOLO26"),
        ({"description": "Ultralytics rtdetr-l model trained on x"}, "Ultralytics RT-DETR"),
        ({"head": "RTDETRDecoder"}, "Ultralytics RT-DETR"),
        ({"head": "Detect", "end2end": "True"}, "YOLOv10/YOLO26"),
    ],
)
def test_six_numbers_for_each_are_told_apart_by_what_the_file_says(metadata, layout, tmp_path):
    path = made.answering(tmp_path / "n.onnx", np.zeros((1, 300, 6)), **metadata)
    assert Network(path).layout.name == layout

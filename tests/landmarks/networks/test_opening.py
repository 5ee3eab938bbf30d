"""Files that are no networks, or none that is understood: one line each, and nothing is taken."""

import os
import subprocess
import sys

import numpy as np
import pytest
from onnx import TensorProto, helper, numpy_helper

pytest.importorskip("onnxruntime", reason="pip install 'ros_visualise[detect]' to run this")

import made_networks as made

from ros_visualise.core.errors import OpenError, RosVisualiseError
from ros_visualise.landmarks.networks import session
from ros_visualise.landmarks.networks.candidates import SelectionRules
from ros_visualise.landmarks.networks.layouts import ALL
from ros_visualise.landmarks.networks.network import Network
from ros_visualise.landmarks.networks.session import Provider

GRAY = np.full((64, 64), 50, np.uint8)


def refused(path, *args, **more):
    with pytest.raises(OpenError) as caught:
        Network(str(path), *args, **more)
    said = str(caught.value)
    assert "\n" not in said
    assert caught.value.exit_status == 2
    return said


def test_a_file_that_is_not_there(tmp_path):
    assert "no such file; give the ONNX file" in refused(tmp_path / "none.onnx")
    assert "no such file; give the ONNX file" in refused(tmp_path)


@pytest.mark.parametrize("data", [b"x", b"PK\x03\x04" * 100, b"\x08\x07" * 5000, os.urandom(9999)])
def test_a_file_that_is_something_else(data, tmp_path):
    path = tmp_path / "n.onnx"
    path.write_bytes(data)
    assert "give an ONNX file" in refused(path)
    path.write_bytes(b"")
    assert "empty; give an ONNX file" in refused(path)


def test_a_file_that_is_cut(tmp_path):
    path = made.yolo_8(tmp_path / "n.onnx", 64, 64)
    with open(path, "rb+") as file:
        file.truncate(os.path.getsize(path) // 2)
    assert "give an ONNX file" in refused(path)


def test_a_file_that_is_too_large(tmp_path, monkeypatch):
    path = tmp_path / "n.onnx"
    with path.open("wb") as file:
        file.truncate(700 << 20)  # takes no room on the disk
    said = refused(path)
    assert "a network of 700 MiB; limit: 512 MiB; if you trust it, add --max-m" in said


def test_onnxruntime_is_missing(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    said = refused(made.yolo_8(tmp_path / "n.onnx", 64, 64))
    assert said.endswith(f": {sys.executable} -m pip install onnxruntime")


def test_cuda_is_missing(tmp_path):
    if "CUDAExecutionProvider" in session._load_onnxruntime().get_available_providers():
        pytest.skip("it is not")
    said = refused(made.yolo_8(tmp_path / "n.onnx", 64, 64), Provider.CUDA)
    assert said.startswith("provider=cuda: ")
    assert "onnxruntime-gpu" in said


@pytest.mark.parametrize("place", ["../weights.bin", "/etc/hostname", "sub/../../weights.bin"])
def test_weights_from_elsewhere_are_not_read(place, tmp_path):
    (tmp_path / "weights.bin").write_bytes(bytes(16))
    folder = tmp_path / "folder" / "sub"
    folder.mkdir(parents=True)
    path = with_weights(folder.parent / "n.onnx", place)
    assert f"refers to weights in {place}, which is not in its folder" in refused(path)


def test_weights_by_a_link_from_elsewhere_are_not_read(tmp_path):
    (tmp_path / "weights.bin").write_bytes(bytes(16))
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "weights.bin").symlink_to("../weights.bin")
    assert "not in its folder" in refused(
        with_weights(tmp_path / "folder" / "n.onnx", "weights.bin")
    )


def test_weights_beside_it_are_read_and_missed(tmp_path):
    path = with_weights(tmp_path / "n.onnx", "weights.bin")
    assert "no such file; it should hold the weights of n.onnx" in refused(path)
    (tmp_path / "weights.bin").write_bytes(bytes(16))
    assert "supported" in refused(path)  # it is read, and is no detector


def test_weights_of_a_long_name_are_read(tmp_path):
    name = "w" * 200
    path = with_weights(tmp_path / "n.onnx", name)
    (tmp_path / name).write_bytes(bytes(16))
    assert "supported" in refused(path)
    assert "not in its folder" in refused(
        with_weights(tmp_path / "m.onnx", "../" * 60 + "etc/hostname")
    )


def test_weights_that_are_too_large(tmp_path):
    path = with_weights(tmp_path / "n.onnx", "weights.bin")
    with (tmp_path / "weights.bin").open("wb") as file:
        file.truncate(700 << 20)
    assert "a network of 700 MiB; limit: 512 MiB" in refused(path)


def with_weights(path, place):
    """A network whose constant lies in another file."""
    weights = numpy_helper.from_array(np.zeros(4, np.float32), "weights")
    weights.ClearField("raw_data")
    weights.data_location = TensorProto.EXTERNAL
    entry = weights.external_data.add()
    entry.key, entry.value = "location", place
    graph = made.Graph()
    graph.add("Add", "images", "weights", output="y")
    body = helper.make_graph(
        graph.nodes,
        "made",
        [helper.make_tensor_value_info("images", *made.image_input(4, 4))],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT, None)],
        [weights],
    )
    model = helper.make_model(body, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    path.write_bytes(model.SerializeToString())
    return path


def test_all_memory_is_not_taken(tmp_path):
    graph = made.Graph()
    shape = graph.add("Mul", graph.add("Shape", "images"), graph.constant(100, np.int64))
    graph.add("ReduceSum", graph.add("ConstantOfShape", shape), output="y")
    path = made.save(
        tmp_path / "n.onnx",
        graph,
        {"images": (TensorProto.FLOAT, [1, 3, "h", "w"])},
        {"y": (TensorProto.FLOAT, None)},
    )
    assert f"{path}: needs more than " in refused(path)


@pytest.mark.parametrize(
    ("shape", "kind"),
    [
        ([4, 3, 64, 64], TensorProto.FLOAT),
        ([1, 1, 64, 64], TensorProto.FLOAT),
        ([1, 64, 64, 3], TensorProto.FLOAT),
        ([1, 3, 64, 64], TensorProto.UINT8),
        ([1, 3, 64], TensorProto.FLOAT),
        ([1, 3, 100_000, 64], TensorProto.FLOAT),
    ],
)
def test_an_input_that_is_not_understood_is_said(shape, kind, tmp_path):
    graph = made.Graph()
    graph.add("Identity", "images", output="y")
    path = made.save(tmp_path / "n.onnx", graph, {"images": (kind, shape)}, {"y": (kind, None)})
    said = refused(path)
    assert f"takes images {shape}" in said
    assert "[1, 3, height, width]" in said


@pytest.mark.parametrize("shape", [(1, 90, 77), (1, 1000), (3, 300, 6), (1, 300, 4), (1, 21, 5)])
def test_a_layout_that_is_not_understood_is_said(shape, tmp_path):
    said = refused(made.answering(tmp_path / "n.onnx", np.zeros(shape)))
    assert f"inputs images [1, 3, 64, 64], outputs output0 {list(shape)}" in said
    assert all(layout.name in said for layout in ALL)


def test_another_task_is_said(tmp_path):
    count = made.cells(64, 64, 8, 16, 32)
    answer = np.zeros((1, 56, count))
    said = refused(made.answering(tmp_path / "n.onnx", answer, task="pose"))
    assert "unsupported network for the task pose: inputs images" in said


def test_names_that_do_not_fit_tell_that_it_is_something_else(tmp_path):
    count = made.cells(64, 64, 8, 16, 32)
    path = made.answering(tmp_path / "n.onnx", np.zeros((1, 10, count)), names="{0: 'a', 1: 'b'}")
    assert "supported" in refused(path)


def test_boxes_that_are_decoded_already_are_not_taken_for_those_of_yolox(tmp_path):
    count = made.cells(64, 64, 8, 16, 32)
    path = made.answering(tmp_path / "n.onnx", np.full((1, count, 10), 30.0))
    assert "supported" in refused(path)


@pytest.mark.parametrize("place", [b"imgsz", b"images", b"output0"])
def test_texts_that_are_none_are_said(place, tmp_path):
    path = tmp_path / "n.onnx"
    made.yolo_8(path, 64, 64, imgsz="[64, 64]")
    path.write_bytes(path.read_bytes().replace(place, b"\xff" + place[1:]))
    assert "give an ONNX file" in refused(path)


def test_names_of_many_lines_are_told_in_one(tmp_path):
    graph = made.Graph()
    graph.add("Identity", "in\nput\x1b[31m", output="out\nput")
    inputs = {"in\nput\x1b[31m": made.image_input(8, 8)}
    path = made.save(tmp_path / "n.onnx", graph, inputs, {"out\nput": (TensorProto.FLOAT, None)})
    assert "inputs input[31m [1, 3, 8, 8], outputs output [1, 3, 8, 8]; " in refused(path)


def test_of_many_inputs_and_outputs_a_few_are_told(tmp_path):
    graph = made.Graph()
    for number in range(500):
        graph.add("Identity", "images", output=f"{'y' * 500}{number}")
    outputs = {node.output[0]: (TensorProto.FLOAT, None) for node in graph.nodes}
    inputs = {"images": made.image_input(8, 8)}
    assert len(refused(made.save(tmp_path / "n.onnx", graph, inputs, outputs))) < 1500


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e30, -1e30])
@pytest.mark.parametrize(
    "rows", ["YOLOv8/11/12", "YOLOv5/YOLOv7", "NanoDet-Plus", "YOLOv10/YOLO26"]
)
def test_numbers_that_are_none_are_nothing(value, rows, tmp_path):
    count = made.cells(64, 64, 8, 16, 32)
    shape = {
        "YOLOv8/11/12": (1, 9, count),
        "YOLOv5/YOLOv7": (1, 3 * count, 10),
        "NanoDet-Plus": (1, made.cells(64, 64, 8, 16, 32, 64), 40),
        "YOLOv10/YOLO26": (1, 300, 6),
    }[rows]
    network = Network(made.answering(tmp_path / "n.onnx", np.full(shape, value)))
    assert network.layout.name == rows
    assert len(network.detect(GRAY, "BGR", SelectionRules())) == 0


def test_ten_thousand_things(tmp_path):
    side = 640
    answer = np.zeros((1, 3 * made.cells(side, side, 8, 16, 32), 7), np.float32)
    places = np.stack(np.meshgrid(np.arange(100), np.arange(100)), axis=-1).reshape(-1, 2)
    answer[0, : len(places), :2] = 6 * places + 20
    answer[0, : len(places), 2:4] = 4
    answer[0, : len(places), 4:6] = 1
    network = Network(made.answering(tmp_path / "n.onnx", answer, side, side))
    pixels = np.zeros((side, side, 3), np.uint8)
    assert len(network.detect(pixels, "BGR", SelectionRules(most=1_000))) == 1_000
    assert len(network.detect(pixels, "BGR", SelectionRules(most=300))) == 300


def test_what_fails_at_a_later_image_costs_that_image(tmp_path):
    """Of a network whose shapes hang on what it sees."""
    graph = made.Graph()
    most = graph.add("ReduceMax", "images", keepdims=0)
    row = graph.add("Cast", graph.add("Mul", most, graph.constant(1000)), to=TensorProto.INT64)
    one = graph.add("Gather", graph.constant(np.zeros((900, 1, 1, 1))), row)
    graph.add("Add", graph.constant(np.zeros((1, 300, 6))), one, output="y")
    inputs = {"images": made.image_input(8, 8)}
    network = Network(made.save(tmp_path / "n.onnx", graph, inputs, {"y": (1, None)}))
    assert len(network.detect(GRAY, "BGR", SelectionRules())) == 0
    with pytest.raises(RosVisualiseError, match=r"n\.onnx: .*Gather") as caught:
        network.detect(GRAY + 200, "BGR", SelectionRules())
    assert "\n" not in str(caught.value)
    assert len(network.detect(GRAY, "BGR", SelectionRules())) == 0


def test_nothing_is_said_on_standard_error(tmp_path):
    path = made.answering(tmp_path / "n.onnx", np.zeros((1, 5)))
    code = (
        "import sys\nfrom ros_visualise.landmarks.networks.network import Network\n"
        "from ros_visualise.core.errors import OpenError\n"
        "try: Network(sys.argv[1])\nexcept OpenError: print('refused')"
    )
    done = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("refused\n", "")


def test_a_process_ends_while_a_network_never_answers(tmp_path):
    """A thread in C++ at the end of Python would abort it."""
    code = (
        "import sys, threading, time\n"
        "from ros_visualise.landmarks.networks.stopping import is_anybody_at_work\n"
        "from ros_visualise.landmarks.networks.network import Network\n"
        "threading.Thread(target=Network, args=(sys.argv[1],), daemon=True).start()\n"
        "while not is_anybody_at_work(): time.sleep(0.01)\n"
        "time.sleep(0.5)\n"
    )
    path = made.endless(tmp_path / "n.onnx")
    done = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")

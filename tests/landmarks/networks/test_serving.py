"""Several images in one run give what each gives alone, also from a process that serves others."""

import os
import socket
import threading
from collections import Counter

import cv2
import made_networks as made
import numpy as np
import pytest
from onnx import TensorProto

from ros_visualise.core.errors import OpenError, RosVisualiseError
from ros_visualise.landmarks.networks import gpus, serving
from ros_visualise.landmarks.networks.batches import group_of, run_together
from ros_visualise.landmarks.networks.candidates import SelectionRules
from ros_visualise.landmarks.networks.network import Network
from ros_visualise.landmarks.networks.remote import RemoteSession, ServerAddress
from ros_visualise.landmarks.networks.serving import NetworkServer
from ros_visualise.landmarks.networks.session import OnnxSession, Provider
from ros_visualise.nodes.landmark_detector import OWN_MODEL

NAMES = ["boxes", "scores", "classes", "points", "point_variances"]
CLOSE = 1e-3  # of scores, and of boxes as fractions of the image


def helipads(count):
    """Images (1, 3, 320, 320) with a helipad each, at different places; the last one is blank."""
    images = []
    for number in range(count - 1):
        picture = np.full((320, 320, 3), (60, 140, 90), np.uint8)
        centre = (110 + 20 * number, 160 - 15 * number)
        cv2.circle(picture, centre, 60, (70, 70, 70), -1)
        cv2.circle(picture, centre, 54, (255, 255, 255), 4)
        cv2.putText(picture, "H", (centre[0] - 25, centre[1] + 25), 0, 2.4, (255, 255, 255), 10)
        images.append(picture)
    images.append(np.zeros((320, 320, 3), np.uint8))
    return [np.float32(one.transpose(2, 0, 1)[None]) / 255 for one in images]


def free(path, add):
    """A network from images [n, 3, 8, 8] to what ``add`` makes of them in a graph."""
    graph = made.Graph()
    add(graph)
    inputs = {"images": (TensorProto.FLOAT, ["n", 3, 8, 8])}
    return OnnxSession(
        made.save(path, graph, inputs, {"y": (TensorProto.FLOAT, None)}), Provider.CPU, 1
    )


@pytest.fixture(scope="module")
def own():
    return OnnxSession(str(OWN_MODEL), Provider.CPU, 1)


@pytest.mark.parametrize("least", [0.0, 0.3, 1.0])
def test_our_network_finds_in_a_batch_what_it_finds_alone(own, least):
    inputs = [{"images": one, "min_score": np.float32([least])} for one in helipads(4)]
    together = run_together(own, inputs, NAMES)
    found = 0
    for one, answer in zip(inputs, together, strict=True):
        for name, expected, got in zip(NAMES, own.run(one, NAMES), answer, strict=True):
            assert got.shape == expected.shape
            scale = 320 if name in ("boxes", "points") else 1
            if name != "point_variances":
                assert np.abs(got - expected).max(initial=0) <= CLOSE * scale
        found += int((answer[1] > 0.6).sum())
    assert found == (3 if least < 1 else 0)


@pytest.mark.parametrize("image", [0, 1])
def test_padding_for_gpus_adds_nothing(own, image):
    inputs = {"images": helipads(2)[image], "min_score": np.float32([0.3])}
    expected = own.run(inputs, NAMES)
    found = own.run({**inputs, "rows": np.int64([7])}, [*NAMES, "image_numbers"])
    *found, numbers = (one[0] for one in found)
    assert numbers.shape[0] % 7 == 0 < numbers.shape[0]
    assert not found[1][numbers < 0].any()
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one[numbers == 0], other[0], atol=CLOSE)


def test_only_what_can_be_stacked_is_run_together(own, tmp_path):
    image = helipads(1)[0]

    def group(session=own, image=image, least=0.5):
        return group_of(session, {"images": image, "min_score": np.float32([least])}, NAMES)

    assert group() == group(image=image + 1)
    assert group() != group(image=image[:, :, :256])
    assert group() != group(least=0.6)
    fixed = OnnxSession(made.yolo_8(tmp_path / "n.onnx", 64, 64), Provider.CPU, 1)
    assert group_of(fixed, {"images": image}, ["output0"]) is None


def test_answers_are_split_by_image(tmp_path):
    session = free(
        tmp_path / "n.onnx", lambda g: g.add("ReduceMax", "images", axes=[2, 3], output="y")
    )
    inputs = [{"images": np.full((1, 3, 8, 8), value, np.float32)} for value in (1, 5, 3)]
    answers = run_together(session, inputs, ["y"])
    assert [one[0].shape for one in answers] == [(1, 3, 1, 1)] * 3
    assert [one[0].max() for one in answers] == [1, 5, 3]


def test_a_network_that_answers_for_one_gets_one_after_the_other(tmp_path):
    session = free(tmp_path / "n.onnx", lambda g: g.add("ReduceMax", "images", output="y"))
    inputs = [{"images": np.full((1, 3, 8, 8), value, np.float32)} for value in (1, 5)]
    assert [one[0].max() for one in run_together(session, inputs, ["y"])] == [1, 5]


def failing(graph):
    """Fails on an image that is brighter than 0.9."""
    row = graph.add("Cast", graph.add("ReduceMax", "images", axes=[1, 2, 3], keepdims=0), to=7)
    graph.add("Gather", graph.constant([7.0]), row, output="y")


def test_an_image_that_the_network_fails_on_costs_no_other_one(tmp_path):
    session = free(tmp_path / "n.onnx", failing)
    inputs = [{"images": np.full((1, 3, 8, 8), value, np.float32)} for value in (0, 1, 0.5)]
    good, bad, other = run_together(session, inputs, ["y"])
    assert good[0].tolist() == other[0].tolist() == [7.0]
    assert isinstance(bad, RosVisualiseError)


@pytest.fixture
def server(tmp_path):
    """A server on a thread, for networks on the CPU."""
    address = ServerAddress(str(tmp_path / "socket"), b"key")
    made = NetworkServer(address, Provider.CPU, 1, 0)
    made._fills = True  # as on a GPU
    threading.Thread(target=made.serve, daemon=True).start()
    return address


def lost(reason):
    raise AssertionError(reason)


def test_images_of_several_clients_are_run_in_batches(server, own, monkeypatch):
    sizes = Counter()

    def counted(session, several, *others):
        sizes[len(several)] += 1
        return run_together(session, several, *others)

    monkeypatch.setattr(serving, "run_together", counted)
    monkeypatch.setattr(serving, "_GATHER_S", 5.0)  # all come in time on any machine
    images = helipads(3)
    sessions = [RemoteSession(str(OWN_MODEL), server, lost) for _ in images]
    answers = {}

    def ask(number):
        least = np.float32([0.3])
        answers[number] = sessions[number].run(
            {"images": images[number], "min_score": least}, NAMES
        )

    asking = [threading.Thread(target=ask, args=(number,)) for number in range(3)]
    for one in asking:
        one.start()
    for one in asking:
        one.join(60)
    assert sizes == {4: 1}  # filled up
    assert [answers[number][1].max(initial=0) > 0.6 for number in range(3)] == [True, True, False]


def test_a_served_network_is_waited_for_beside_rospy(server):
    image = {"images": helipads(1)[0]}
    before = socket.getdefaulttimeout()
    socket.setdefaulttimeout(60)  # as rospy does
    try:
        found = RemoteSession(str(OWN_MODEL), server, lost)
        for _ in range(2):
            assert len(found.run(image, NAMES)) == 5
    finally:
        socket.setdefaulttimeout(before)


def test_a_served_network_knows_what_the_file_says(server, own, tmp_path):
    found = RemoteSession(str(OWN_MODEL), server, lost)
    assert (found.inputs, found.outputs) == (own.inputs, own.outputs)
    assert found.metadata == own.metadata
    with pytest.raises(OpenError, match="no such file"):
        RemoteSession(str(tmp_path / "none.onnx"), server, lost)
    larger = np.zeros((1, 3, 640, 640), np.float32)  # needs more shared memory than before
    for image in (helipads(1)[0], larger):
        assert len(found.run({"images": image}, NAMES)) == 5


def test_a_detector_asks_the_server_only_for_networks_on_a_gpu(server, monkeypatch):
    monkeypatch.setattr("ros_visualise.landmarks.networks.remote._used", (server, lost))
    image = np.uint8(helipads(2)[0][0].transpose(1, 2, 0) * 255)
    here, there = (Network(str(OWN_MODEL), one) for one in (Provider.CPU, Provider.CUDA))
    assert isinstance(there._session, RemoteSession)
    assert not isinstance(here._session, RemoteSession)
    expected, found = (one.detect(image, "BGR", SelectionRules(0.6)) for one in (here, there))
    assert len(expected) == 1
    np.testing.assert_allclose(found.scores, expected.scores, atol=CLOSE)
    np.testing.assert_allclose(found.boxes_xyxy, expected.boxes_xyxy, atol=320 * CLOSE)


def test_a_lost_server_is_a_reason(monkeypatch, tmp_path):
    monkeypatch.setattr("ros_visualise.landmarks.networks.remote._PATIENCE_S", 0.2)
    reasons = []
    with pytest.raises(OpenError, match="cannot connect to the process that runs the networks"):
        RemoteSession("n.onnx", ServerAddress(str(tmp_path / "none"), b"key"), reasons.append)
    assert reasons == ["cannot connect to the process that runs the networks"]


@pytest.mark.parametrize(
    ("chosen", "devices", "count"),
    [
        (None, [], 0),
        (None, ["nvidia0", "nvidia1", "nvidiactl", "nvidia-uvm"], 2),
        (None, ["nvgpu"], 1),
        ("", ["nvidia0"], 0),
        ("-1", ["nvidia0"], 0),
        ("0,3", [], 2),
        ("1,-1,2", [], 1),
        ("GPU-8932f937", [], 1),
    ],
)
def test_gpus_are_counted(chosen, devices, count, tmp_path, monkeypatch):
    monkeypatch.setattr(gpus, "_DEVICES", tmp_path)
    for name in devices:
        (tmp_path / name).touch()
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    if chosen is not None:
        monkeypatch.setitem(os.environ, "CUDA_VISIBLE_DEVICES", chosen)
    assert gpus.gpus() == count

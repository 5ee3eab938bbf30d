"""A network in whole numbers answers as it did in floats, but for a little."""

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

pytest.importorskip("onnxruntime", reason="pip install 'ros_visualise[detect]' to run this")

import onnxruntime
from integers import to_integers, without_copies

SIDE, WIDTH = 32, 8


def made_network() -> onnx.ModelProto:
    """A few layers, named as those of our network."""
    random = np.random.default_rng(3)
    weights, nodes = [], []

    def conv(name: str, taken: str, inputs: int) -> str:
        values = random.normal(0, np.sqrt(2 / 9 / inputs), (WIDTH, inputs, 3, 3))
        given = [taken]
        for kind, numbers in (("weight", values), ("bias", random.normal(0, 0.1, WIDTH))):
            weight = numpy_helper.from_array(numbers.astype(np.float32), f"{name}.{kind}")
            weights.append(weight)
            nodes.append(helper.make_node("Identity", [weight.name], [f"{name}.{kind}.copy"]))
            given.append(f"{name}.{kind}.copy")
        pads = {"kernel_shape": [3, 3], "pads": [1] * 4}
        nodes.append(helper.make_node("Conv", given, [name], f"/network/{name}/Conv", **pads))
        output, relu = f"{name}.relu", f"/network/{name}/Relu"
        nodes.append(helper.make_node("Relu", [name], [output], relu))
        return output

    seen = conv("stem.0", "images", 3)
    body = conv("stages.0.0", seen, WIDTH)
    nodes.append(helper.make_node("Add", [seen, body], ["sum"], "/network/stages.0/Add"))
    answer = conv("heads.0", conv("towers.0.0", "sum", WIDTH), WIDTH)
    nodes.append(helper.make_node("Identity", [answer], ["answer"], "answer"))
    graph = helper.make_graph(
        nodes,
        "made",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, SIDE, SIDE])],
        [helper.make_tensor_value_info("answer", TensorProto.FLOAT, [1, WIDTH, SIDE, SIDE])],
        weights,
    )
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 16)], ir_version=8)


def pictures(count: int) -> list[np.ndarray]:
    random = np.random.default_rng(4)
    return [random.uniform(0, 1, (1, 3, SIDE, SIDE)).astype(np.float32) for _ in range(count)]


def answer(model: onnx.ModelProto, picture: np.ndarray) -> np.ndarray:
    session = onnxruntime.InferenceSession(model.SerializeToString())
    return session.run(["answer"], {"images": picture})[0]


def takers(model: onnx.ModelProto, kind: int) -> set[str]:
    """The convolutions whose weights are stored in such numbers."""
    weights = {each.name: each.data_type for each in model.graph.initializer}
    handed = {
        node.output[0]: weights.get(node.input[0])
        for node in model.graph.node
        if node.op_type == "DequantizeLinear"
    }
    known = weights | handed
    convs = [node for node in model.graph.node if node.op_type == "Conv"]
    return {node.name.split("/")[2] for node in convs if known[node.input[1]] == kind}


@pytest.fixture(scope="module")
def both() -> tuple[onnx.ModelProto, onnx.ModelProto]:
    return made_network(), to_integers(made_network(), pictures(8))


def test_it_answers_as_before_but_for_a_little(both):
    before, after = (answer(model, pictures(9)[-1]) for model in both)
    spread = np.sqrt(np.mean((after - before) ** 2) / np.mean(before**2))
    assert 0 < spread < 0.03


def test_layers_that_see_pixels_and_heads_stay_floats(both):
    assert takers(both[1], TensorProto.INT8) == {"stages.0.0", "towers.0.0"}
    assert takers(both[1], TensorProto.FLOAT) == {"stem.0", "heads.0"}


def test_weights_have_seven_bits(both):
    stored = (numpy_helper.to_array(each) for each in both[1].graph.initializer)
    whole = [values for values in stored if values.dtype == np.int8 and values.ndim == 4]
    assert len(whole) == 2
    assert all(np.abs(values).max() in (63, 64) for values in whole)


def test_layers_stay_in_their_order(both):
    before, after = (
        [node.name for node in model.graph.node if node.op_type == "Conv"] for model in both
    )
    assert after == before


def test_without_copies_the_weights_themselves_are_used():
    model = made_network()
    session = onnxruntime.InferenceSession(model.SerializeToString())
    picture = np.random.default_rng(0).uniform(0, 1, (1, 3, SIDE, SIDE)).astype(np.float32)
    before = session.run(None, {"images": picture})[0]
    plain = without_copies(model)
    stored = {each.name for each in plain.graph.initializer}
    convs = [node for node in plain.graph.node if node.op_type == "Conv"]
    assert len(convs) == 4
    assert all(set(node.input[1:]) <= stored for node in convs)
    session = onnxruntime.InferenceSession(plain.SerializeToString())
    assert np.array_equal(before, session.run(None, {"images": picture})[0])

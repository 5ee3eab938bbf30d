"""The mean of two refinement heads, with the first network of one of them."""

import numpy as np
import onnx
import pytest
from average import average

from ros_visualise.core.errors import OpenError
from ros_visualise.nodes.landmark_detector import OWN_MODEL


def weights(path):
    stored = onnx.load(str(path)).graph.initializer
    return {each.name: onnx.numpy_helper.to_array(each) for each in stored}


@pytest.fixture
def other(tmp_path):
    """The shipped network with a refinement head of zeros."""
    model = onnx.load(str(OWN_MODEL))
    for each in model.graph.initializer:
        values = onnx.numpy_helper.to_array(each)
        if values.dtype.kind == "f":
            each.CopyFrom(onnx.numpy_helper.from_array(0 * values, each.name))
    onnx.save(model, str(tmp_path / "other.onnx"))
    return tmp_path / "other.onnx"


def test_the_mean_of_the_heads_and_nothing_else_changes(other, tmp_path):
    average(OWN_MODEL, other, tmp_path / "mean.onnx", 0.25, {"seed": "5"})
    before, after = weights(OWN_MODEL), weights(tmp_path / "mean.onnx")
    head = [name for name in before if "Conv" in name or "second" in name]
    changed = {name for name in before if not np.array_equal(before[name], after[name])}
    assert changed
    assert all(name.startswith("last/") for name in changed)
    for name in changed:
        assert after[name] == pytest.approx(0.75 * before[name].astype(float), rel=2e-3, abs=1e-6)
    assert len(changed) >= len([name for name in head if name.startswith("last/")])
    lines = {each.key: each.value for each in onnx.load(str(tmp_path / "mean.onnx")).metadata_props}
    assert lines["seed"] == "5"
    assert "helipad" in lines["names"]


def test_heads_of_other_shapes_are_refused(other, tmp_path):
    model = onnx.load(str(other))
    last = next(each for each in model.graph.initializer if each.name.endswith("head.bias"))
    last.CopyFrom(onnx.numpy_helper.from_array(np.zeros(14, np.float32), last.name))
    onnx.save(model, str(tmp_path / "wrong.onnx"))
    with pytest.raises(OpenError, match="different shapes"):
        average(OWN_MODEL, tmp_path / "wrong.onnx", tmp_path / "mean.onnx", 0.5, {})

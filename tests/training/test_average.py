"""The mean of the networks of two files."""

import importlib

import numpy as np
import onnx
import pytest
from pictures import write_world

from ros_visualise.core.errors import OpenError
from ros_visualise.nodes.landmark_detector import OWN_MODEL


@pytest.fixture(scope="module")
def averaging():
    """The module, where there is a torch that fits NumPy."""
    torch = pytest.importorskip("torch", reason="training/README.md says how to install it")
    if torch.__version__ < "2" <= np.__version__:
        pytest.skip("this torch needs NumPy 1")
    return importlib.import_module("average")


@pytest.fixture(scope="module")
def pictures(opengl, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pictures")
    write_world(folder / "world", (5, 0), 2)
    return folder


@pytest.fixture
def other(tmp_path):
    """The shipped network with a refinement head of zeros."""
    model = onnx.load(str(OWN_MODEL))
    for each in model.graph.initializer:
        values = onnx.numpy_helper.to_array(each)
        if each.name.startswith("last/") and values.dtype == np.float16:
            each.CopyFrom(onnx.numpy_helper.from_array(0 * values, each.name))
    onnx.save(model, str(tmp_path / "other.onnx"))
    return tmp_path / "other.onnx"


def test_the_mean_has_so_much_of_each(averaging, other, pictures, tmp_path):
    averaging.average(OWN_MODEL, other, pictures, tmp_path / "mean.onnx", (0.5, 0.25), 5)
    before, after = (averaging.read_start(p) for p in (OWN_MODEL, tmp_path / "mean.onnx"))
    for old, new in zip(before.first[:25], after.first[:25], strict=True):
        step = 2 * float(old.weight.abs().max()) / 63  # of integers of 7 bits
        assert new.weight.numpy() == pytest.approx(old.weight.numpy(), abs=step)
    for number in (1, 6, 12):
        old, new = before.second[number].weight, after.second[number].weight
        assert new.numpy() == pytest.approx(0.75 * old.numpy(), rel=3e-3, abs=1e-5)
    assert after.classes == before.classes


def test_only_the_layers_of_one_run_are_averaged(averaging):
    torch, nn = averaging.torch, averaging.nn
    old, new = ([averaging.Layer(at * torch.ones(2, 2), torch.ones(2))] * 2 for at in (1, 0))
    (layer,) = averaging.mean(old, new, 0.25, nn.Sequential(nn.Linear(2, 2)))
    assert (layer.weight == 0.75).all()


def test_networks_of_other_shapes_are_refused(averaging, other, pictures, tmp_path):
    model = onnx.load(str(other))
    for each in model.metadata_props:
        if each.key == "names":
            each.value = "{0: 'helipad'}"
    onnx.save(model, str(tmp_path / "wrong.onnx"))
    with pytest.raises(OpenError, match="different shapes"):
        averaging.average(OWN_MODEL, tmp_path / "wrong.onnx", pictures, tmp_path / "m", (1, 1), 0)

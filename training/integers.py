"""Convolutions with 8-bit integers, which are faster than with floats.

The ranges of their outputs are measured on pictures, to choose the scale of the integers. Only the
proposing network is quantized: it takes most of the time, and its boxes are refined anyway. Its
first layer and its heads stay in floats, and so does the refinement head, which decides.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterable
from itertools import islice
from pathlib import Path

import ros_visualise  # noqa: F401  # before onnxruntime, which sends reports otherwise

# isort: split
import numpy as np
import numpy.typing as npt
import onnx
from onnxruntime.quantization import (
    CalibrationDataReader,
    QuantFormat,
    QuantType,
    quantize_static,
)
from onnxruntime.quantization.shape_inference import quant_pre_process

Images = npt.NDArray[np.float32]
_MEASURED = 100
"""Pictures by which the ranges of numbers are measured."""
_OPERATIONS = "Conv", "Relu", "Add", "Resize"
_SCOPE = re.compile(r"/network(_1)?/")
_FLOATS = re.compile(r"(stem\.0|heads\.\d)[/_.]")


class _Reader(CalibrationDataReader):
    """Gives one image after the other, as onnxruntime asks for them."""

    def __init__(self, images: list[Images]) -> None:
        self._images = iter(images)

    def get_next(self) -> dict[str, Images] | None:
        image = next(self._images, None)
        return None if image is None else {"images": image}


def to_integers(model: onnx.ModelProto, pictures: Iterable[Images]) -> onnx.ModelProto:
    """The same model, most of whose convolutions take and give 8 bits.

    Weights have 7 bits and a scale for each channel: with 8, sums of two products are too large for
    the instructions of processors that have none for neural networks.

    Args:
        model: of the first network, as `export` writes it.
        pictures: (1, 3, H, W), RGB in 0 to 1; the first hundred are taken.
    """
    measured = list(islice(pictures, _MEASURED))
    with tempfile.TemporaryDirectory() as folder:
        made, plain, whole = (Path(folder) / f"{name}.onnx" for name in ("made", "plain", "whole"))
        onnx.save(model, made)
        quant_pre_process(str(made), str(plain), skip_symbolic_shape=True)
        quantize_static(
            plain,
            whole,
            _Reader(measured),
            QuantFormat.QDQ,
            per_channel=True,
            reduce_range=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            nodes_to_quantize=[
                each.name for each in onnx.load(plain).graph.node if _is_chosen(each)
            ],
        )
        result = onnx.load(whole)
    _sort(result.graph, [node.name for node in model.graph.node])
    return result


def without_copies(model: onnx.ModelProto) -> onnx.ModelProto:
    """The same model, with no copies of its weights: newer torch writes one for a second use.

    Otherwise quantization would take a copy for a result, with a coarse scale at run time.
    """
    stored = {each.name for each in model.graph.initializer}
    copies = {}
    for node in list(model.graph.node):
        for at, name in enumerate(node.input):
            node.input[at] = copies.get(name, name)
        if node.op_type == "Identity" and node.input[0] in stored:
            copies[node.output[0]] = node.input[0]
            model.graph.node.remove(node)
    return model


def _is_chosen(node: onnx.NodeProto) -> bool:
    in_scope = node.op_type in _OPERATIONS and _SCOPE.match(node.name)
    return bool(in_scope) and not _FLOATS.search(node.name)


def _sort(graph: onnx.GraphProto, names: list[str]) -> None:
    """Nodes in the order of these names; the others where the next one needs them."""
    makers = {output: node for node in graph.node for output in node.output}
    known = {node.name: node for node in graph.node}
    done: dict[str, onnx.NodeProto] = {}

    def add(node: onnx.NodeProto) -> None:
        if node.output[0] not in done:
            for name in node.input:
                if name in makers:
                    add(makers[name])
            done[node.output[0]] = node

    for name in names:
        if name in known:
            add(known[name])
    del graph.node[:]
    graph.node.extend(done.values())

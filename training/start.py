"""Networks read back from the ONNX file that `export` wrote, so that training goes on from them.

The file has no normalisation: it is part of the convolutions. Here it is measured anew on pictures
and put behind them, so that the networks answer as before and learn as before.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import onnx
import torch
from export import LAYOUT, VERSION
from google.protobuf.message import DecodeError
from layers import Layer
from network import BOX, POINT, SPREAD, Network
from onnx import numpy_helper
from second import Second
from torch import Tensor, nn

from ros_visualise.core.errors import OpenError

_SCALE = 2.0  # of a layer's weights, by those of a fresh one: what follows makes up for it


class Start(NamedTuple):
    """Both networks in a file, in the order of execution."""

    first: list[Layer]
    second: list[Layer]
    classes: tuple[str, ...]
    steps: int

    @property
    def widths(self) -> tuple[int, int]:
        """Channels of the first layer of each."""
        return len(self.first[0].bias), len(self.second[0].bias)


def read_start(path: Path) -> Start:
    """Read a file that `export.write_onnx` wrote."""
    try:
        model = onnx.load(str(path))
    except (OSError, DecodeError) as error:
        raise OpenError(f"{path}: no ONNX file to start from: {error}") from error
    told = {each.key: each.value for each in model.metadata_props}
    if (told.get("layout"), told.get("version")) != (LAYOUT, VERSION):
        raise OpenError(f"{path}: to start from, it takes a file that this train.py wrote")
    names = ast.literal_eval(told["names"])
    first, second = (list(_layers(model.graph, prefix)) for prefix in ("first/", "last/"))
    return Start(first, second, tuple(names[key] for key in sorted(names)), int(told["steps"]))


def start_first(network: Network, start: Start, classes: tuple[str, ...], pictures: Tensor) -> None:
    """Give a network what the file has; classes that the file does not know begin anew.

    Args:
        classes: those of the network.
        pictures: (B, 3, H, W) as it learns from; some hundred are enough to measure.
    """
    _fill(network, start.first, set(network.heads), _rows(start.classes, classes), (pictures,))


def start_second(
    second: Second, start: Start, classes: tuple[str, ...], parts: tuple[Tensor, Tensor, Tensor]
) -> None:
    """`start_first` for the refinement head; ``parts`` are the inputs of `Second`."""
    rows = _rows((*start.classes, ""), (*classes, ""))  # the last one: none of them
    _fill(second, start.second, {second.head}, rows, parts)


def _layers(graph: onnx.GraphProto, prefix: str) -> Iterator[Layer]:
    """The layers of one network; after its last one may come those of its second run."""
    values = _weights(graph)
    for node in graph.node:
        names = node.input[1:]
        known = node.op_type in ("Conv", "Gemm") and all(name in values for name in names)
        if known and node.name.startswith(prefix):
            yield Layer(*(torch.from_numpy(values[name].astype(np.float32)) for name in names))


def _weights(graph: onnx.GraphProto) -> dict[str, npt.NDArray[Any]]:
    """The weights in the file, converted from half floats or integers."""
    values = {each.name: numpy_helper.to_array(each) for each in graph.initializer}
    for node in graph.node:
        if node.op_type == "Cast" and node.input[0] in values:
            values[node.output[0]] = values[node.input[0]]
        elif node.op_type == "DequantizeLinear" and node.input[0] in values:
            numbers, scale, zero = (values[name] for name in node.input)
            shape = (-1, *[1] * (numbers.ndim - 1))
            values[node.output[0]] = (numbers - zero.reshape(shape)) * scale.reshape(shape)
    return values


def _rows(theirs: tuple[str, ...], ours: tuple[str, ...]) -> dict[int, int]:
    """A head's numbers -> which ones of the file they are: classes by name, then the rest."""
    same = {ours.index(name): n for n, name in enumerate(theirs) if name in ours}
    rest = range(BOX + POINT + SPREAD)
    return same | {len(ours) + number: len(theirs) + number for number in rest}


def _fill(
    network: nn.Module,
    layers: list[Layer],
    heads: set[nn.Module],
    rows: dict[int, int],
    inputs: tuple[Tensor, ...],
) -> None:
    """Fill each layer when it is run: to measure what it gives, those before must be filled."""
    upcoming = iter(layers)
    scaled: list[tuple[float, Tensor]] = []

    def fill(module: nn.Module, _: object) -> None:
        layer = next(upcoming)
        if module in heads:
            own, file = list(rows), list(rows.values())
            module.weight[own], module.bias[own] = layer.weight[file], layer.bias[file]
        elif module.bias is not None:
            module.weight.copy_(layer.weight)
            module.bias.copy_(layer.bias)
        else:
            scale = float(_SCALE * module.weight.std() / layer.weight.std())
            module.weight.copy_(scale * layer.weight)
            scaled.append((scale, layer.bias))

    def measure(module: nn.BatchNorm2d, given: tuple[Tensor, ...]) -> None:
        scale, bias = scaled.pop()
        module.running_var, module.running_mean = torch.var_mean(given[0], dim=(0, 2, 3))
        module.weight.copy_((module.running_var + module.eps).sqrt() / scale)
        module.bias.copy_(bias + module.running_mean / scale)

    hooks = []
    for module in network.modules():
        if isinstance(module, nn.Conv2d | nn.Linear):
            hooks.append(module.register_forward_pre_hook(fill))
        elif isinstance(module, nn.BatchNorm2d):
            hooks.append(module.register_forward_pre_hook(measure))
    with torch.no_grad():
        network.eval()(*inputs)
    network.train()
    for hook in hooks:
        hook.remove()

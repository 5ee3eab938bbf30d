"""Write the trained networks as an ONNX file that gives boxes and ground points in pixels.

python training/export.py OUT/checkpoint.pt OUT/second.pt OUT/pictures aerial.onnx
"""

from __future__ import annotations

import argparse
import copy
import json
import tempfile
import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import advice  # noqa: F401
import numpy as np
import onnx
import torch
from batches import for_batches
from integers import Images, to_integers, without_copies
from network import STRIDES, Network, decode, enlarge, halve
from onnx import TensorProto, helper, numpy_helper
from running import run
from second import Second, cut_both, decode_parts, parts_about
from store import some_pictures
from torch import Tensor, nn

from ros_visualise.landmarks.networks.layouts.layout import MIN_SCORE_INPUT

OUTPUTS = ["boxes", "scores", "classes", "points", "point_variances"]
LAYOUT, VERSION = "ros_visualise", "3"
_SIDE = 640
_OPSET = 16  # has GridSample
_LEAST_SCORE = 0.1  # of boxes that are looked at
_MOST, _OVERLAP = 24, 0.7
"""Number of refined boxes per image, and their largest overlap."""
_LIKELY = 0.1  # probability of a class from which on a box is looked at once more
_WITHIN = 0.8  # of a box in another one: it shows a part of the same thing
_LARGE = 1000  # numbers from which on weights are stored as halves


class First(nn.Module):
    """A network with what comes after it: boxes (1, N, 4) and scores (1, 1, N) of all cells.

    It sees the image and the same at half its size, where large things are as it learned them.
    """

    def __init__(self, network: Network) -> None:
        super().__init__()
        self.network = network

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor]:
        boxes, scores = self._cells(images)
        large, surely = self._cells(halve(images))
        boxes = torch.cat([boxes, enlarge(large)])
        return boxes[None], torch.cat([scores, surely])[None, None]

    def _cells(self, images: Tensor) -> tuple[Tensor, Tensor]:
        raw, classes = self.network(images)[0], self.network.classes
        boxes = decode(raw[:, classes:], *_grid(images))[0]
        return boxes, raw[:, :classes].amax(dim=1).sigmoid()


class Look(NamedTuple):
    """Output of the refinement head for N boxes, in pixels from the centre of the first pixel."""

    kinds: Tensor
    """(N, classes + 1) probabilities; the last one: that it is nothing."""
    boxes: Tensor
    """(N, 4) x0 y0 x1 y1."""
    points: Tensor
    """(N, 2) what it stands on."""
    variances: Tensor
    """(N, 2) square pixels."""


class Last(nn.Module):
    """The refinement head for the chosen boxes, applied again, mirrored, to detections.

    Args:
        widen: factor for the variances of the points, as `evaluate.py` measures it.
    """

    def __init__(self, second: Second, widen: float) -> None:
        super().__init__()
        self.second, self.widen = second, widen

    def forward(
        self, images: Tensor, boxes: Tensor, scores: Tensor, chosen: Tensor
    ) -> tuple[Tensor, ...]:
        """Answer for the chosen cells of an image (1, 3, H, W), RGB in 0 to 1.

        Args:
            boxes, scores: as `First` gives them.
            chosen: (M, 3); the last number is the cell's.

        Returns:
            ``boxes`` (1, N, 4) x0 y0 x1 y1, ``scores`` (1, N), ``classes`` (1, N), ``points`` and
            ``point_variances`` (1, N, 2), pixels counted from the edges of the first one.
        """
        cells = chosen[:, 2]
        look = self._look(images, boxes[0, cells])
        likely = torch.nonzero(look.kinds[:, :-1].amax(dim=1) > _LIKELY)[:, 0]
        again = self._look(images, look.boxes[likely], mirrored=True)
        sure, kinds = ((look.kinds[likely] + again.kinds) / 2)[:, :-1].max(dim=1)
        sure = sure * scores[0, 0, cells[likely]].sqrt()
        sure = sure * ~_are_parts(again.boxes, sure, kinds)
        told = (again.boxes + 0.5, sure, kinds, again.points + 0.5, self.widen * again.variances)
        return tuple(each[None] for each in told)

    def _look(self, images: Tensor, boxes: Tensor, mirrored: bool = False) -> Look:
        middles, halves, shares = parts_about(boxes)
        reach = halves * torch.tensor([-1.0, 1.0]) if mirrored else halves
        raw = self.second(cut_both(images, middles, reach), halves, shares)
        kinds = self.second.classes + 1
        found, points, spread = decode_parts(raw[:, kinds:], shares)
        corners = middles.repeat(1, 2) + found * reach.repeat(1, 2)
        return Look(
            raw[:, :kinds].softmax(dim=1),
            corners[:, [2, 1, 0, 3]] if mirrored else corners,
            middles + points * reach,
            (torch.exp(spread) * halves) ** 2,
        )


def _are_parts(boxes: Tensor, sure: Tensor, kinds: Tensor) -> Tensor:
    """Mask of N boxes that lie inside a more certain one of their class."""
    low = torch.maximum(boxes[:, None, :2], boxes[None, :, :2])
    high = torch.minimum(boxes[:, None, 2:], boxes[None, :, 2:])
    shared = (high - low).clamp(min=0).prod(dim=2)
    areas = (boxes[:, 2:] - boxes[:, :2]).clamp(min=0).prod(dim=1)
    within = shared > _WITHIN * areas[:, None]
    within = within & (sure[None] > sure[:, None]) & (kinds[None] == kinds[:, None])
    return within.any(dim=1)


def _grid(images: Tensor) -> tuple[Tensor, Tensor]:
    """`make_grid` for the size of the image at run time."""
    centres, strides = [], []
    for stride in STRIDES:
        y = torch.arange(images.shape[2] // stride)[:, None]
        x = torch.arange(images.shape[3] // stride)[None, :]
        at = torch.stack([x + 0 * y, y + 0 * x], dim=-1).reshape(-1, 2).float()
        centres.append((at + 0.5) * stride - 0.5)
        strides.append(torch.full_like(at[:, :1], float(stride)))
    return torch.cat(centres), torch.cat(strides)


def write_onnx(
    network: Network,
    second: Second,
    classes: tuple[str, ...],
    path: Path,
    about: dict[str, str],
    pictures: Iterable[Images],
    widen: float = 1.0,
) -> None:
    """Write the file, for images of any size, several at once: the network, the choice of boxes,
    the refinement head.

    Args:
        about: more lines for its metadata.
        pictures: as `to_integers` takes them.
        widen: factor for the variances of the points, as `evaluate.py` measures it.
    """
    image = torch.zeros(1, 3, 256, 320)
    cells = sum((256 // each) * (320 // each) for s in STRIDES for each in (s, 2 * s))
    free = {"images": {2: "height", 3: "width"}}
    first = _export(
        First(_plain(network)),
        (image,),
        ["images"],
        ["cell_boxes", "cell_scores"],
        {**free, "cell_boxes": {1: "cells"}, "cell_scores": {2: "cells"}},
    )
    last = _export(
        Last(_plain(second), widen).eval(),
        (image, torch.ones(1, cells, 4), torch.ones(1, 1, cells), torch.ones(3, 3).long()),
        ["images", "cell_boxes", "cell_scores", "chosen"],
        OUTPUTS,
        {
            **free,
            "cell_boxes": {1: "cells"},
            "cell_scores": {2: "cells"},
            "chosen": {0: "found"},
            **{name: {1: "found"} for name in OUTPUTS},
        },
    )
    model = for_batches(_joined(to_integers(first, pictures), last))
    lines = {"layout": LAYOUT, "version": VERSION, "license": "BSD-3-Clause"}
    lines |= {
        "names": str(dict(enumerate(classes))),
        "stride": str(2 * STRIDES[-1]),
        "imgsz": f"[{_SIDE}, {_SIDE}]",
    }
    helper.set_model_props(model, {**lines, **first_layer(model), **about})
    _store_as_halves(model.graph)
    onnx.checker.check_model(model)
    onnx.save(model, str(path))


def _plain(module: nn.Module) -> nn.Module:
    """A copy to run, with channels first: with them last, as in training, torch 1.13 fails here."""
    return copy.deepcopy(module).cpu().eval().to(memory_format=torch.contiguous_format)


def _export(
    module: nn.Module,
    inputs: tuple[Tensor, ...],
    input_names: Sequence[str],
    output_names: Sequence[str],
    free: dict[str, dict[int, str]],
) -> onnx.ModelProto:
    with tempfile.NamedTemporaryFile(suffix=".onnx") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what it cannot foresee of shapes, which are free
        torch.onnx.utils.export(
            module,
            inputs,
            file.name,
            opset_version=_OPSET,
            input_names=input_names,
            output_names=output_names,
            dynamic_axes=free,
        )
        return without_copies(onnx.load(file.name))


def _joined(first: onnx.ModelProto, last: onnx.ModelProto) -> onnx.ModelProto:
    """One model of both, with the choice of boxes between them.

    Who wants only what has a score of ``min_score`` may say so: boxes that cannot reach it are not
    looked at again. The score is at most the root of that of the box, as `Last` has it.
    """
    first, last = (
        onnx.compose.add_prefix(each, prefix, rename_inputs=False, rename_outputs=False)
        for each, prefix in ((first, "first/"), (last, "last/"))
    )
    limits = {
        "most": np.int64([_MOST]),
        "overlap": np.float32([_OVERLAP]),
        "usual": np.float32([_LEAST_SCORE]),
        MIN_SCORE_INPUT: np.float32([0]),
    }
    choice = [
        helper.make_node("Mul", [MIN_SCORE_INPUT, MIN_SCORE_INPUT], ["squared"], "squared"),
        helper.make_node("Max", ["squared", "usual"], ["least"], "least"),
        helper.make_node(
            "NonMaxSuppression",
            ["cell_boxes", "cell_scores", "most", "overlap", "least"],
            ["chosen"],
            "choice",
        ),
    ]
    asked = helper.make_tensor_value_info(MIN_SCORE_INPUT, TensorProto.FLOAT, [1])
    graph = helper.make_graph(
        [*first.graph.node, *choice, *last.graph.node],
        "aerial",
        [*first.graph.input, asked],
        last.graph.output,
        [
            *first.graph.initializer,
            *(numpy_helper.from_array(value, name) for name, value in limits.items()),
            *last.graph.initializer,
        ],
    )
    opset = helper.make_opsetid("", _OPSET)
    return helper.make_model(graph, opset_imports=[opset], ir_version=first.ir_version)


def _store_as_halves(graph: onnx.GraphProto) -> None:
    """Store large weights as float16, and compute with float32: half the file."""
    casts = []
    for weights in graph.initializer:
        values = numpy_helper.to_array(weights)
        if weights.data_type == TensorProto.FLOAT and values.size >= _LARGE:
            name = weights.name
            weights.CopyFrom(numpy_helper.from_array(values.astype(np.float16), f"{name}/half"))
            casts.append(helper.make_node("Cast", [weights.name], [name], to=TensorProto.FLOAT))
    nodes = [*casts, *graph.node]
    del graph.node[:]
    graph.node.extend(nodes)


def first_layer(model: onnx.ModelProto) -> dict[str, str]:
    """Kernels (N, 3, 3, 3) and biases (N,) of the first convolution, as lines for the metadata.

    onnxruntime gives nobody the weights of a file; so the lesson on vision reads them here.
    """
    first = next(one for one in model.graph.node if one.op_type == "Conv")
    weights = {one.name: numpy_helper.to_array(one) for one in model.graph.initializer}
    kernels, biases = (json.dumps(weights[name].tolist()) for name in first.input[1:])
    return {"first_kernels": kernels, "first_biases": biases}


def save_second(second: Second, path: Path) -> None:
    """Write the weights of the refinement head."""
    state = {"classes": second.classes, "width": second.width, "weights": second.cpu().state_dict()}
    torch.save(state, path)


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("second", type=Path)
    parser.add_argument("pictures", type=Path, help="folder of worlds, to measure ranges by")
    parser.add_argument("onnx", type=Path)
    parser.add_argument("--widen", type=float, default=1.0, help="factor for points' variances")
    asked = parser.parse_args()
    state, again = (torch.load(path, "cpu") for path in (asked.checkpoint, asked.second))
    network = Network(len(state["classes"]), state["width"])
    network.load_state_dict(state["average"])
    second = Second(again["classes"], again["width"])
    second.load_state_dict(again["weights"])
    about = {"seed": str(state["seed"]), "steps": str(state["steps"])}
    pictures = some_pictures(asked.pictures, state["seed"])
    write_onnx(network, second, state["classes"], asked.onnx, about, pictures, asked.widen)
    return 0


if __name__ == "__main__":
    run(main)

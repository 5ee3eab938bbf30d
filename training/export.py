"""Write a trained network as an ONNX file that gives boxes and ground points in pixels.

python training/export.py OUT/checkpoint.pt aerial.onnx
"""

from __future__ import annotations

import argparse
import copy
import json
import sys
import warnings
from pathlib import Path

import onnx
import torch
from network import STRIDES, Network, decode
from torch import Tensor, nn

OUTPUTS = ["boxes", "scores", "classes", "points", "point_variances"]
VERSION = "1"
_SIDE = 640


class Exported(nn.Module):
    """A network with all that comes after it but the suppression of repeated boxes.

    Args:
        widen: factor for the variances of the points, as `evaluate.py` measures it.
    """

    def __init__(self, network: Network, widen: float) -> None:
        super().__init__()
        self.network, self.widen = network, widen

    def forward(self, images: Tensor) -> tuple[Tensor, ...]:
        """The cells of an image (1, 3, H, W), RGB in 0 to 1; H and W are multiples of 32.

        Returns:
            ``boxes`` (1, N, 4) x0 y0 x1 y1, ``scores`` (1, N), ``classes`` (1, N), ``points`` and
            ``point_variances`` (1, N, 2), pixels counted from the edges of the first one.
        """
        raw, classes = self.network(images)[0], self.network.classes
        scores, kinds = raw[:, :classes].max(dim=1)
        boxes, points, spread = decode(raw[:, classes:], *_grid(images))
        variances = self.widen * torch.exp(2 * spread)
        found = (boxes + 0.5, scores.sigmoid(), kinds, points + 0.5, variances)
        return tuple(each[None] for each in found)


def _grid(images: Tensor) -> tuple[Tensor, Tensor]:
    """As `make_grid`, of the image's own size when the file is run."""
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
    classes: tuple[str, ...],
    path: Path,
    about: dict[str, str],
    widen: float = 1.0,
) -> None:
    """Write the file, for images of any size.

    Args:
        about: more lines for its metadata.
    """
    whole = Exported(copy.deepcopy(network).eval(), widen).eval()
    free = {"images": {2: "height", 3: "width"}, **{name: {1: "cells"} for name in OUTPUTS}}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what it cannot foresee of shapes, which are free
        torch.onnx.utils.export(
            whole,
            (torch.zeros(1, 3, 256, 320),),
            str(path),
            opset_version=13,
            input_names=["images"],
            output_names=OUTPUTS,
            dynamic_axes=free,
        )
    model = onnx.load(str(path))
    lines = {"layout": "ros_visualise", "version": VERSION, "license": "BSD-3-Clause"}
    lines |= {
        "names": str(dict(enumerate(classes))),
        "stride": "32",
        "imgsz": f"[{_SIDE}, {_SIDE}]",
    }
    onnx.helper.set_model_props(model, {**lines, **first_layer(model), **about})
    onnx.save(model, str(path))


def first_layer(model: onnx.ModelProto) -> dict[str, str]:
    """Kernels (N, 3, 3, 3) and biases (N,) of the first convolution, as lines for the metadata.

    onnxruntime gives nobody the weights of a file; so the lesson on vision reads them here.
    """
    first = next(one for one in model.graph.node if one.op_type == "Conv")
    weights = {one.name: onnx.numpy_helper.to_array(one) for one in model.graph.initializer}
    kernels, biases = (json.dumps(weights[name].tolist()) for name in first.input[1:])
    return {"first_kernels": kernels, "first_biases": biases}


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("onnx", type=Path)
    parser.add_argument("--widen", type=float, default=1.0, help="factor for points' variances")
    asked = parser.parse_args()
    state = torch.load(asked.checkpoint)
    network = Network(len(state["classes"]), state["width"])
    network.load_state_dict(state["average"])
    about = {"seed": str(state["seed"]), "steps": str(state["steps"])}
    write_onnx(network, state["classes"], asked.onnx, about, asked.widen)
    return 0


if __name__ == "__main__":
    sys.exit(main())

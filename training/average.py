"""Average the refinement heads of two files that `export.py` wrote.

    python training/average.py START.onnx TRAINED.onnx RESULT.onnx --share 0.5

The first network, and all else, is that of START, bit for bit. Training on few worlds forgets some
of what was learned from many; the mean of the weights before and after keeps both, as long as they
have not diverged.

Source of the idea: Wortsman et al., Robust fine-tuning of zero-shot models, 2022.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import onnx
from onnx import numpy_helper
from running import run

from ros_visualise.core.errors import OpenError

_HEAD = "last/"


def average(start: Path, trained: Path, result: Path, share: float, about: dict[str, str]) -> None:
    """Write the mean.

    Args:
        share: of the trained weights, 0 to 1.
        about: more lines for its metadata.

    Raises:
        OpenError: the heads have different layers.
    """
    model, other = onnx.load(str(start)), onnx.load(str(trained))
    ours, theirs = (list(_head_weights(each)) for each in (model, other))
    shapes = [[list(each.dims) for each in some] for some in (ours, theirs)]
    if shapes[0] != shapes[1]:
        raise OpenError(f"{start} and {trained}: refinement heads of different shapes")
    for own, new in zip(ours, theirs, strict=True):
        old = numpy_helper.to_array(own).astype(np.float64)
        mean = (1 - share) * old + share * numpy_helper.to_array(new)
        kind = numpy_helper.to_array(own).dtype
        own.CopyFrom(numpy_helper.from_array(mean.astype(kind), own.name))
    lines = {each.key: each.value for each in model.metadata_props}
    del model.metadata_props[:]
    onnx.helper.set_model_props(model, {**lines, **about})
    onnx.checker.check_model(model)
    onnx.save(model, str(result))


def _head_weights(model: onnx.ModelProto) -> Iterator[onnx.TensorProto]:
    """The weights of the refinement head in the order of execution, each once."""
    stored = {each.name: each for each in model.graph.initializer}
    cast = {node.output[0]: node.input[0] for node in model.graph.node if node.op_type == "Cast"}
    names = _weight_names(model.graph.node)
    for name in dict.fromkeys(cast.get(name, name) for name in names):
        if name in stored:
            yield stored[name]


def _weight_names(nodes: Sequence[onnx.NodeProto]) -> Iterator[str]:
    for node in nodes:
        if node.op_type in ("Conv", "Gemm") and node.name.startswith(_HEAD):
            yield from node.input[1:]


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("start", type=Path)
    parser.add_argument("trained", type=Path)
    parser.add_argument("result", type=Path)
    parser.add_argument(
        "--share", type=float, default=0.5, help="of TRAINED (default: %(default)s)"
    )
    asked = parser.parse_args()
    average(asked.start, asked.trained, asked.result, asked.share, {})
    return 0


if __name__ == "__main__":
    run(main)

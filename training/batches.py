"""Batches for a network that was exported for one image: a free first side of its input.

What comes before the choice of boxes gets one more side; the boxes of all images go through the
refinement head together, and the output ``image_numbers`` says which image each object is in. An
image gives the same numbers alone and among others.

GPUs prepare anew for each number of boxes, and fail on none: the optional input ``rows`` (1,) pads
them to its multiples. What is added has the score 0 and the image -1.

python training/batches.py shipped.onnx aerial.onnx
"""

from __future__ import annotations

import argparse
from pathlib import Path

import advice  # noqa: F401
import numpy as np
import onnx
from onnx import NodeProto, TensorProto, helper, numpy_helper

from ros_visualise.landmarks.networks.layouts.own import IMAGE_NUMBERS, ROWS

_AXES = 3
"""The input of a Slice with its axes."""


class _Graph:
    """A graph whose nodes are replaced and added to, in their order."""

    def __init__(self, model: onnx.ModelProto) -> None:
        self.graph = model.graph
        self.nodes = list(model.graph.node)
        self._added = 0
        self.known = {one.name: numpy_helper.to_array(one) for one in model.graph.initializer}
        for node in self.nodes:
            if node.op_type == "Constant":
                self.known[node.output[0]] = numpy_helper.to_array(node.attribute[0].t)

    def takers(self, name: str) -> list[NodeProto]:
        """Nodes that take a tensor."""
        return [node for node in self.nodes if name in node.input]

    def maker(self, name: str) -> NodeProto:
        """The node that gives a tensor."""
        return next(node for node in self.nodes if name in node.output)

    def replace(self, name: str, by: str, but: tuple[NodeProto, ...] = ()) -> None:
        """Let those that take a tensor take another one."""
        for node in self.takers(name):
            if node not in but:
                node.input[:] = [by if one == name else one for one in node.input]

    def drop(self, node: NodeProto) -> None:
        """Remove a node that changes nothing any longer."""
        self.nodes.remove(node)
        self.replace(node.output[0], node.input[0])

    def constant(self, values: object, dtype: type = np.int64) -> str:
        """A new constant."""
        self._added += 1
        name = f"batch/constant_{self._added}"
        self.known[name] = np.array(values, dtype)
        self.graph.initializer.append(numpy_helper.from_array(self.known[name], name))
        return name

    def add(self, before: NodeProto | None, kind: str, *inputs: str, **attributes: object) -> str:
        """A new node in front of another one, or the last; its output."""
        self._added += 1
        name = f"batch/{kind}_{self._added}"
        node = helper.make_node(kind, list(inputs), [name], name, **attributes)
        at = len(self.nodes) if before is None else self.nodes.index(before)
        self.nodes.insert(at, node)
        return name

    def attribute(self, node: NodeProto, name: str) -> onnx.AttributeProto:
        return next(one for one in node.attribute if one.name == name)

    def is_first(self, node: NodeProto) -> bool:
        """True if it takes the first entry along the first side."""
        if node.op_type != "Gather" or self.known.get(node.input[1], np.ones(1)).shape != ():
            return False
        return int(self.known[node.input[1]]) == 0 and self.attribute(node, "axis").i == 0


def for_batches(model: onnx.ModelProto) -> onnx.ModelProto:
    """The same network for any number of images of one size.

    Args:
        model: as `export.write_onnx` joins it.
    """
    made = onnx.ModelProto()
    made.CopyFrom(model)
    graph = _Graph(made)
    _widen_first(graph)
    chosen, valid = _pad_choice(graph)
    image, likely = _number_cells(graph, chosen)
    likely, is_real = _pad_likely(graph, likely, valid)
    second = graph.add(_after(graph, likely), "Gather", image, likely, axis=0)
    looks = [node for node in graph.nodes if node.op_type == "GridSample"]
    for number, of in ((slice(0, 2), image), (slice(2, 4), second)):
        slots, count = _slots(graph, of)
        for node in looks[number]:
            _sample(graph, node, slots, count)
    _separate(graph, second, is_real)
    _mark(graph, second, is_real)
    del made.graph.node[:]
    made.graph.node.extend(graph.nodes)
    made.graph.input[0].type.tensor_type.shape.dim[0].dim_param = "images"
    numbers = helper.make_tensor_value_info(IMAGE_NUMBERS, TensorProto.INT64, [1, "found"])
    made.graph.output.append(numbers)
    made.graph.initializer.append(numpy_helper.from_array(np.int64([1]), ROWS))
    made.graph.input.append(helper.make_tensor_value_info(ROWS, TensorProto.INT64, [1]))
    onnx.checker.check_model(made)
    return made


def _after(graph: _Graph, name: str) -> NodeProto:
    """The node after the one that gives a tensor."""
    return graph.nodes[graph.nodes.index(graph.maker(name)) + 1]


def _widen_first(graph: _Graph) -> None:
    """Keep the side of the images from the raw cells to the choice of boxes."""
    chooser = next(node for node in graph.nodes if node.op_type == "NonMaxSuppression")
    wide = set[str]()
    for node in graph.nodes[: graph.nodes.index(chooser)]:
        if graph.is_first(node) and node.input[0].startswith("first//network"):
            graph.drop(node)
            wide.add(node.input[0])
        elif wide & {*node.input}:
            _widen(graph, node)
            wide |= {*node.output}
    for name in ("cell_boxes", "cell_scores"):
        node = graph.maker(name)
        while node.op_type == "Unsqueeze" and graph.known[node.input[1]].tolist() != [0]:
            node = graph.maker(node.input[0])
        if node.output[0] == name:
            graph.nodes.remove(node)
            graph.maker(node.input[0]).output[0] = name
        else:
            graph.drop(node)


def _widen(graph: _Graph, node: NodeProto) -> None:
    """Count the sides of a node's inputs from one that is in front of them."""
    if node.op_type == "Slice" and graph.known[node.input[_AXES]][0] >= 0:
        node.input[_AXES] = graph.constant(graph.known[node.input[_AXES]] + 1)
    for one in node.attribute:
        if one.name == "perm":
            one.ints[:] = [0, *(side + 1 for side in one.ints)]
        elif one.name == "axes":
            one.ints[:] = [side + 1 for side in one.ints]
        elif one.name == "axis" and one.i >= 0:
            one.i += 1


def _padding(graph: _Graph, before: NodeProto, table: str) -> tuple[str, str]:
    """Numbers of the rows that are to be added to a table, and which rows are then its own."""
    rows, one = ROWS, graph.constant([1])
    shape = graph.add(before, "Shape", table)
    count = graph.add(before, "Slice", shape, graph.constant([0]), one, graph.constant([0]))
    but_one = graph.add(before, "Sub", rows, one)
    multiples = graph.add(before, "Div", graph.add(before, "Add", count, but_one), rows)
    least = graph.add(before, "Min", but_one, one)  # an empty table is padded, too
    wanted = graph.add(before, "Mul", graph.add(before, "Max", multiples, least), rows)
    missing = graph.add(before, "Sub", wanted, count)
    zero, step = graph.constant(0), graph.constant(1)
    ends = [graph.add(before, "Squeeze", each) for each in (missing, wanted)]
    new, every = (graph.add(before, "Range", zero, end, step) for end in ends)
    return new, graph.add(before, "Greater", count, every)


def _pad_choice(graph: _Graph) -> tuple[str, str]:
    """Add rows to the chosen cells: the first cells, of all images in turn."""
    before = _after(graph, "chosen")
    new, valid = _padding(graph, before, "chosen")
    shape = graph.add(before, "Shape", "images")
    images = graph.add(before, "Gather", shape, graph.constant([0]), axis=0)
    columns = [graph.add(before, "Mod", new, images)]
    columns += [graph.add(before, "Mul", new, graph.constant([0]))] * 2
    side = graph.constant([1])
    added = [graph.add(before, "Unsqueeze", each, side) for each in columns]
    table = graph.add(before, "Concat", *added, axis=1)
    users = graph.takers("chosen")
    chosen = graph.add(before, "Concat", "chosen", table, axis=0)
    for node in users:
        if not node.name.startswith("batch/"):
            node.input[:] = [chosen if one == "chosen" else one for one in node.input]
    return chosen, valid


def _pad_likely(graph: _Graph, likely: str, valid: str) -> tuple[str, str]:
    """Take no padded row for likely, and pad what is likely, by all rows in turn."""
    found = graph.maker(likely)
    while found.op_type != "NonZero":
        found = graph.maker(found.input[0])
    found.input[0] = graph.add(found, "And", found.input[0], valid)
    before = _after(graph, likely)
    new, is_real = _padding(graph, before, likely)
    every = graph.add(before, "Max", graph.add(before, "Shape", valid), graph.constant([1]))
    added = graph.add(before, "Mod", new, every)
    padded = graph.add(before, "Concat", likely, added, axis=0)
    graph.replace(likely, padded, but=(graph.maker(padded), *_shapes_of(graph, likely)))
    return padded, is_real


def _shapes_of(graph: _Graph, name: str) -> list[NodeProto]:
    return [node for node in graph.takers(name) if node.name.startswith("batch/Shape")]


def _number_cells(graph: _Graph, chosen: str) -> tuple[str, str]:
    """Count the cells of all images through; names of the images' numbers and of likely rows."""
    cells = next(
        node
        for node in graph.takers(chosen)
        if node.op_type == "Gather" and int(graph.known[node.input[1]]) == 2
    )
    after = _after(graph, cells.output[0])
    image = graph.add(after, "Gather", chosen, graph.constant(0), axis=1)
    shape = graph.add(after, "Shape", "cell_boxes")
    count = graph.add(after, "Gather", shape, graph.constant(1), axis=0)
    first = graph.add(after, "Mul", image, count)
    flat = graph.add(after, "Add", first, cells.output[0])
    again = graph.maker(flat)
    likely = next(
        n.input[1] for n in graph.takers(cells.output[0]) if n.input[0] == cells.output[0]
    )
    graph.replace(cells.output[0], flat, but=(again,))
    for name, sides in (("cell_boxes", [-1, 4]), ("cell_scores", [-1])):
        for node in [node for node in graph.takers(name) if graph.is_first(node)]:
            inner = [one for one in graph.takers(node.output[0]) if graph.is_first(one)]
            table = graph.add(node, "Reshape", name, graph.constant(sides))
            for one in (node, *inner):
                graph.nodes.remove(one)
                graph.replace(one.output[0], table)
    return image, likely


def _slots(graph: _Graph, image: str) -> tuple[str, str]:
    """For objects with the numbers of their images: their rows in a table with as many rows for
    each image, and the number of rows of the table."""
    before = _after(graph, image)
    same = _same(graph, before, image)
    shape = graph.add(before, "Shape", image)
    size = graph.add(before, "Squeeze", shape)
    numbers = graph.add(before, "Range", graph.constant(0), size, graph.constant(1))
    column = graph.add(before, "Unsqueeze", numbers, graph.constant([1]))
    is_before = graph.add(before, "Greater", column, numbers)
    both = graph.add(
        before, "Cast", graph.add(before, "And", same, is_before), to=TensorProto.INT64
    )
    rank = graph.add(before, "ReduceSum", both, graph.constant([1]), keepdims=0)
    ranks = graph.add(before, "Concat", rank, graph.constant([0]), axis=0)
    largest = graph.add(before, "ReduceMax", ranks, axes=[0], keepdims=1)
    each = graph.add(before, "Add", largest, graph.constant([1]))
    images = graph.add(before, "Shape", "images")
    images = graph.add(before, "Gather", images, graph.constant([0]), axis=0)
    first = graph.add(before, "Mul", image, each)
    return graph.add(before, "Add", first, rank), graph.add(before, "Mul", images, each)


def _same(graph: _Graph, before: NodeProto, image: str) -> str:
    column = graph.add(before, "Unsqueeze", image, graph.constant([1]))
    return graph.add(before, "Equal", column, image)


def _sample(graph: _Graph, node: NodeProto, slots: str, count: str) -> None:
    """Cut the parts out of the images that they are of."""
    grid = graph.maker(node.input[1])
    side = int(graph.known[grid.input[1]][2])
    rest = graph.constant([side, side, 2])
    shape = graph.add(grid, "Concat", count, rest, axis=0)
    blank = graph.add(grid, "ConstantOfShape", shape)
    rows = graph.add(grid, "Unsqueeze", slots, graph.constant([1]))
    table = graph.add(grid, "ScatterND", blank, rows, grid.input[0])
    images = graph.add(grid, "Gather", graph.add(grid, "Shape", "images"), graph.constant([0]))
    wanted = graph.add(grid, "Concat", images, graph.constant([-1, side, 2]), axis=0)
    grid.input[:] = [table, wanted]
    chain = [node]
    for _ in range(3):  # the first one of all, as channels, parts first
        chain += graph.takers(chain[-1].output[0])
    last = _after(graph, chain[-1].output[0])
    split = graph.add(last, "Reshape", node.output[0], graph.constant([0, 3, -1, side, side]))
    turned = graph.add(last, "Transpose", split, perm=[0, 2, 1, 3, 4])
    parts = graph.add(last, "Reshape", turned, graph.constant([-1, 3, side, side]))
    cut = graph.add(last, "Gather", parts, slots, axis=0)
    for one in chain[1:]:
        graph.nodes.remove(one)
    graph.replace(chain[-1].output[0], cut)


def _separate(graph: _Graph, image: str, is_real: str) -> None:
    """Let no object be a part of one in another image, or of one that was added."""
    kinds = next(
        node
        for node in graph.nodes
        if node.op_type == "Equal" and not node.name.startswith("batch/")
    )
    after = _after(graph, kinds.output[0])
    same = _same(graph, after, image)
    both = graph.add(after, "And", kinds.output[0], graph.add(after, "And", same, is_real))
    graph.replace(kinds.output[0], both, but=(graph.maker(both),))


def _mark(graph: _Graph, image: str, is_real: str) -> None:
    """Give the numbers of the images; what was added has none, and no score."""
    last = graph.maker("scores")
    last.input[0] = graph.add(
        last, "Mul", last.input[0], graph.add(last, "Cast", is_real, to=TensorProto.FLOAT)
    )
    number = graph.add(None, "Where", is_real, image, graph.constant([-1]))
    added = [number, graph.constant([0])]
    graph.nodes.append(helper.make_node("Unsqueeze", added, [IMAGE_NUMBERS]))


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("onnx", type=Path, help="file for one image")
    parser.add_argument("batches", type=Path, help="file to write")
    asked = parser.parse_args()
    onnx.save(for_batches(onnx.load(asked.onnx)), str(asked.batches))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

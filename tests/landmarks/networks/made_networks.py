"""Tiny ONNX files that find one bright spot: each answers in the layout of a real network.

All look for the brightest pixel of their first channel, so that a test can tell by where it is
found whether the image lay in the right place, with the right colour first. They answer with a box
of ``SIZE`` pixels about the centre of that pixel, of class ``CLASS``, with a score of ``SCORE``.
"""

import itertools
import math

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

SIZE = (24.0, 40.0)
CLASS = 2
CLASSES = 5
SCORE = 0.75
FAR = -1e4
"""Where the decoys lie that have no score."""


def cells(width, height, *strides):
    return sum(math.ceil(width / s) * math.ceil(height / s) for s in strides)


class Graph:
    """An ONNX graph that grows node by node."""

    def __init__(self):
        self.nodes, self.constants, self._count = [], [], itertools.count()

    def constant(self, values, dtype=np.float32):
        name = f"constant{next(self._count)}"
        self.constants.append(numpy_helper.from_array(np.array(values, dtype), name))
        return name

    def add(self, op, *inputs, output=None, **attributes):
        output = output or f"made{next(self._count)}"
        self.nodes.append(helper.make_node(op, list(inputs), [output], **attributes))
        return output

    def brightest(self, image):
        """Column and row of the brightest pixel's centre, (1, 2), counted from the edges."""
        first = self.add(
            "Slice", image, *(self.constant([n], np.int64) for n in (0, 1)), self._axis(1)
        )
        width = self.add("Gather", self.add("Shape", image), self.constant(3, np.int64))
        flat = self.add("Reshape", first, self.constant([1, -1], np.int64))
        at = self.add("ArgMax", flat, axis=1, keepdims=1)
        row, column = self.add("Div", at, width), self.add("Mod", at, width)
        both = self.add("Cast", self.add("Concat", column, row, axis=1), to=TensorProto.FLOAT)
        return self.add("Add", both, self.constant([[0.5, 0.5]]))

    def _axis(self, number):
        return self.constant([number], np.int64)

    def repeated(self, row, count, decoy):
        """The row (1, n) first, then rows of ``decoy``: (1, count, n)."""
        others = self.constant(np.tile(np.array([decoy], np.float32), (count - 1, 1)))
        rows = self.add("Concat", row, others, axis=0)
        return self.add("Unsqueeze", rows, self.constant([0], np.int64))


def save(path, graph, inputs, outputs, metadata=()):
    """Write a graph; inputs and outputs are name -> (type, shape)."""
    made = [
        [helper.make_tensor_value_info(name, *what) for name, what in some.items()]
        for some in (inputs, outputs)
    ]
    body = helper.make_graph(graph.nodes, "made", *made, graph.constants)
    model = helper.make_model(body, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    for key, value in dict(metadata).items():
        entry = model.metadata_props.add()
        entry.key, entry.value = key, value
    onnx.save(model, str(path))
    return str(path)


def image_input(width, height, dtype=TensorProto.FLOAT):
    return dtype, [1, 3, height, width]


def _begun(half):
    graph = Graph()
    image = "images"
    if half:
        image = graph.add("Cast", image, to=TensorProto.FLOAT)
    return graph, graph.brightest(image)


def _scores(score=SCORE):
    return [score if number == CLASS else 0.01 for number in range(CLASSES)]


def _finish(path, graph, answer, width, height, half=False, free=False, **metadata):
    if half:
        answer = graph.add("Cast", answer, to=TensorProto.FLOAT16)
    graph.add("Identity", answer, output="output0")
    kind = TensorProto.FLOAT16 if half else TensorProto.FLOAT
    shape = (kind, [1, 3, "height", "width"] if free else [1, 3, height, width])
    return save(path, graph, {"images": shape}, {"output0": (kind, None)}, metadata)


def yolo_8(path, width, height, half=False, **metadata):
    graph, at = _begun(half)
    row = graph.add("Concat", at, graph.constant([[*SIZE, *_scores()]]), axis=1)
    count = cells(width, height, 8, 16, 32)
    rows = graph.repeated(row, count, [FAR] * 4 + [0.0] * CLASSES)
    answer = graph.add("Transpose", rows, perm=[0, 2, 1])
    return _finish(path, graph, answer, width, height, half, **metadata)


def yolo_5(path, width, height, half=False, **metadata):
    graph, at = _begun(half)
    scores = [1.0, *_scores()]
    row = graph.add("Concat", at, graph.constant([[*SIZE, *scores]]), axis=1)
    count = 3 * cells(width, height, 8, 16, 32)
    answer = graph.repeated(row, count, [FAR] * 4 + [0.0] + [0.9] * CLASSES)
    return _finish(path, graph, answer, width, height, half, **metadata)


def yolo_10(path, width, height, half=False, free=False, **metadata):
    graph, at = _begun(half)
    size = graph.constant([np.array(SIZE) / 2])
    corners = [graph.add("Sub", at, size), graph.add("Add", at, size)]
    row = graph.add("Concat", *corners, graph.constant([[SCORE, CLASS]]), axis=1)
    answer = graph.repeated(row, 300, [0.0] * 6)
    return _finish(path, graph, answer, width, height, half, free, **metadata)


def _cell_of(graph, at, width):
    """The cell of stride 8 that a point is in: column and row (1, 2), and its number (1, 1)."""
    cell = graph.add("Floor", graph.add("Div", at, graph.constant([[8.0, 8.0]])))
    steps = graph.constant([[1.0], [math.ceil(width / 8)]])
    return cell, graph.add("Cast", graph.add("MatMul", cell, steps), to=TensorProto.INT64)


def _in_its_cell(graph, number, row, count, decoy):
    """Rows of ``decoy`` (1, count, n), but ``row`` (1, n) at a number."""
    others = graph.constant(np.tile(np.array(decoy, np.float32), (count, 1)))
    rows = graph.add("ScatterND", others, number, row)
    return graph.add("Unsqueeze", rows, graph.constant([0], np.int64))


def yolox(path, width, height, half=False, **metadata):
    graph, at = _begun(half)
    cell, number = _cell_of(graph, at, width)
    in_cell = graph.add("Sub", graph.add("Div", at, graph.constant([[8.0, 8.0]])), cell)
    values = [*np.log(np.array(SIZE) / 8), 1.0, *_scores()]
    row = graph.add("Concat", in_cell, graph.constant([values]), axis=1)
    count = cells(width, height, 8, 16, 32)
    decoy = [0.0] * 5 + [0.9] * CLASSES
    answer = _in_its_cell(graph, number, row, count, decoy)
    return _finish(path, graph, answer, width, height, half, **metadata)


def _normalised(graph, at, width, height):
    center = graph.add("Div", at, graph.constant([[width, height]]))
    return [center, graph.constant([np.array(SIZE) / (width, height)])]


def ultralytics_rt_detr(path, width, height, half=False, **metadata):
    graph, at = _begun(half)
    boxes = _normalised(graph, at, width, height)
    row = graph.add("Concat", *boxes, graph.constant([_scores()]), axis=1)
    answer = graph.repeated(row, 300, [0.5] * 4 + [0.0] * CLASSES)
    return _finish(path, graph, answer, width, height, half, **metadata)


def detr(path, width, height, half=False, **metadata):
    graph, at = _begun(half)
    sizes = graph.add("Cast", "orig_target_sizes", to=TensorProto.FLOAT)
    scale = graph.add("Div", sizes, graph.constant([[width, height]]))
    half_size = graph.constant([np.array(SIZE) / 2])
    corners = [graph.add("Mul", graph.add(op, at, half_size), scale) for op in ("Sub", "Add")]
    row = graph.add("Concat", *corners, axis=1)
    graph.add("Identity", graph.repeated(row, 300, [0.0] * 4), output="boxes")
    graph.add("Identity", graph.constant([[SCORE] + [0.0] * 299]), output="scores")
    graph.add("Identity", graph.constant([[CLASS] * 300], np.int64), output="labels")
    kind = TensorProto.FLOAT16 if half else TensorProto.FLOAT
    inputs = {
        "images": image_input(width, height, kind),
        "orig_target_sizes": (TensorProto.INT64, ["N", 2]),
    }
    outputs = {"labels": (TensorProto.INT64, ["N", 300])}
    outputs |= {name: (TensorProto.FLOAT, None) for name in ("boxes", "scores")}
    return save(path, graph, inputs, outputs, metadata)


POINT = (3.0, 7.0)
"""From the middle of the box to the point that the thing stands on."""
VARIANCES = (4.0, 9.0)


def own(path, width, height, half=False, **metadata):
    graph, at = _begun(half)
    count = 5
    half_size = graph.constant([np.array(SIZE) / 2])
    corners = [graph.add(op, at, half_size) for op in ("Sub", "Add")]
    boxes = graph.add("Concat", *corners, axis=1)
    graph.add("Identity", graph.repeated(boxes, count, [FAR] * 4), output="boxes")
    point = graph.add("Add", at, graph.constant([POINT]))
    graph.add("Identity", graph.repeated(point, count, [FAR] * 2), output="points")
    constants = {"scores": [SCORE] + [0.0] * (count - 1), "point_variances": [VARIANCES] * count}
    for name, values in constants.items():
        graph.add("Identity", graph.constant([values]), output=name)
    graph.add("Identity", graph.constant([[CLASS] * count], np.int64), output="classes")
    kind = TensorProto.FLOAT16 if half else TensorProto.FLOAT
    outputs = {name: (TensorProto.FLOAT, None) for name in ("boxes", "points", *constants)}
    outputs["classes"] = (TensorProto.INT64, None)
    return save(path, graph, {"images": image_input(width, height, kind)}, outputs, metadata)


def rf_detr(path, width, height, half=False, **metadata):
    graph, at = _begun(half)
    row = graph.add("Concat", *_normalised(graph, at, width, height), axis=1)
    graph.add("Identity", graph.repeated(row, 300, [0.5] * 4), output="dets")
    logits = np.full((1, 300, CLASSES), -8.0, np.float32)
    logits[0, 0, CLASS] = np.log(SCORE / (1 - SCORE))
    graph.add("Identity", graph.constant(logits), output="labels")
    kind = TensorProto.FLOAT16 if half else TensorProto.FLOAT
    outputs = {name: (TensorProto.FLOAT, None) for name in ("dets", "labels")}
    return save(path, graph, {"images": image_input(width, height, kind)}, outputs, metadata)


def nanodet(path, width, height, half=False, **metadata):
    graph, at = _begun(half)
    cell, number = _cell_of(graph, at, width)
    inside = graph.add("Sub", at, graph.add("Mul", cell, graph.constant([[8.0, 8.0]])))
    size = graph.constant([np.array(SIZE) / 2])
    sides = [graph.add("Sub", size, inside), graph.add("Add", size, inside)]
    # of bins 0 and 7 alone the mean is 7 p: the logit of p tells any distance up to 7 cells
    share = graph.add("Div", graph.add("Concat", *sides, axis=1), graph.constant([[7.0 * 8] * 4]))
    odds = graph.add("Div", share, graph.add("Sub", graph.constant([[1.0] * 4]), share))
    logits = graph.add("Unsqueeze", graph.add("Log", odds), graph.constant([2], np.int64))
    zero, none = graph.constant(np.zeros((1, 4, 1))), graph.constant(np.full((1, 4, 6), -60.0))
    bins = graph.add("Concat", zero, none, logits, axis=2)
    flat = graph.add("Reshape", bins, graph.constant([1, 32], np.int64))
    row = graph.add("Concat", graph.constant([_scores()]), flat, axis=1)
    count = cells(width, height, 8, 16, 32, 64)
    answer = _in_its_cell(graph, number, row, count, [0.0] * (CLASSES + 32))
    return _finish(path, graph, answer, width, height, half, **metadata)


MAKERS = {
    "ros_visualise": own,
    "YOLOv5/YOLOv7": yolo_5,
    "YOLOv8/11/12": yolo_8,
    "YOLOv10/YOLO26": yolo_10,
    "YOLOX": yolox,
    "RT-DETRv2/D-FINE/DEIM": detr,
    "Ultralytics RT-DETR": ultralytics_rt_detr,
    "RF-DETR": rf_detr,
    "NanoDet-Plus": nanodet,
}
"""Layout -> what writes a file of it."""


def answering(path, answer, width=64, height=64, **metadata):
    """A network that always gives these numbers, as its only output."""
    graph = Graph()
    zero = graph.add("Mul", graph.add("ReduceMean", "images", keepdims=0), graph.constant(0.0))
    graph.add("Add", graph.constant(answer), zero, output="output0")
    inputs = {"images": image_input(width, height)}
    return save(path, graph, inputs, {"output0": (TensorProto.FLOAT, None)}, metadata)


def endless(path):
    """A network that never answers."""
    value = {name: helper.make_tensor_value_info(name, TensorProto.FLOAT, []) for name in "ab"}
    number = helper.make_tensor_value_info("number", TensorProto.INT64, [])
    goes_on = [helper.make_tensor_value_info(n, TensorProto.BOOL, []) for n in ("go", "goes")]
    steps = [helper.make_node("Identity", ["go"], ["goes"]), helper.make_node("Sin", ["a"], ["b"])]
    body = helper.make_graph(
        steps, "body", [number, goes_on[0], value["a"]], [goes_on[1], value["b"]]
    )
    graph = Graph()
    some = graph.add("ReduceMax", "images", keepdims=0)
    limit, always = graph.constant(2**62, np.int64), graph.constant(True, np.bool_)
    graph.add("Loop", limit, always, some, output="output0", body=body)
    inputs = {"images": image_input(64, 64)}
    return save(path, graph, inputs, {"output0": (TensorProto.FLOAT, None)})

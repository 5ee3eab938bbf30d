"""Pre- and postprocessing time of a network: `python benchmarks/landmarks/networks.py [FILE.onnx]`.

Without a file, a made network in the layout of YOLOv8 with 80 classes and 8400 cells, whose some
200 candidates are of random places. Images are noise, of 640x480 and 1920x1080. Milliseconds of
CPU time in one thread, the median of `--rounds`:

- *run*: onnxruntime alone, on numbers that are ready
- *ours*: `Network.detect`, from the image to boxes in its pixels, and what of that is *before* the
  network and *after* it
- *plain*: the loop that is written by hand around onnxruntime for YOLOv8 (letterbox by
  cv2.copyMakeBorder, cv2.dnn.blobFromImage, numpy, cv2.dnn.NMSBoxes); of that layout alone
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import ros_visualise  # noqa: F401  # before onnxruntime, which sends reports otherwise

# isort: split
import cv2
import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper

from ros_visualise.data import Pixels
from ros_visualise.landmarks.networks.candidates import SelectionRules
from ros_visualise.landmarks.networks.network import Network
from ros_visualise.landmarks.networks.preparation import prepare

SIDE, CLASSES, STRIDES = 640, 80, (8, 16, 32)
CHOICE = SelectionRules(min_score=0.25, max_overlap=0.45, most=300)


def made_network(path: str) -> str:
    """A small network of random weights in the layout of YOLOv8."""
    rng = np.random.default_rng(1)
    constants, nodes, heads = [], [], []

    def conv(image: str, inputs: int, outputs: int, size: int, stride: int) -> str:
        name = f"conv{len(nodes)}"
        spread = np.sqrt(2 / (inputs * size * size))
        weights = rng.normal(0, spread, (outputs, inputs, size, size)).astype(np.float32)
        constants.append(numpy_helper.from_array(weights, f"{name}_weights"))
        pads = [size // 2] * 4
        nodes.append(
            helper.make_node(
                "Conv", [image, f"{name}_weights"], [name], strides=[stride] * 2, pads=pads
            )
        )
        return name

    def add(op: str, *inputs: str, **attributes: object) -> str:
        name = f"{op}{len(nodes)}"
        nodes.append(helper.make_node(op, list(inputs), [name], **attributes))
        return name

    def constant(values: object, dtype: type = np.float32) -> str:
        name = f"constant{len(constants)}"
        constants.append(numpy_helper.from_array(np.array(values, dtype), name))
        return name

    image = "images"
    for inputs, outputs in ((3, 12), (12, 24), (24, 32), (32, 32), (32, 32)):
        image = add("Relu", conv(image, inputs, outputs, 3, 2))
        if outputs == 32:
            head = conv(image, 32, 4 + CLASSES, 1, 1)
            heads.append(add("Reshape", head, constant([1, 4 + CLASSES, -1], np.int64)))
    raw = add("Concat", *heads, axis=2)
    first, rest = (f"part{number}" for number in range(2))
    sizes = constant([4, CLASSES], np.int64)
    nodes.append(helper.make_node("Split", [raw, sizes], [first, rest], axis=1))
    places = add("Mul", add("Sigmoid", first), constant(SIDE))
    boxes = add("Mul", places, constant(np.array([1, 1, 0.1, 0.1]).reshape(1, 4, 1)))
    scores = add("Sigmoid", add("Sub", add("Mul", rest, constant(3)), constant(4.3)))
    nodes.append(helper.make_node("Concat", [boxes, scores], ["output0"], axis=1))
    graph = helper.make_graph(
        nodes,
        "made",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, SIDE, SIDE])],
        [helper.make_tensor_value_info("output0", TensorProto.FLOAT, None)],
        constants,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.save(model, path)
    return path


class PlainLoop:
    """What one writes around onnxruntime for a YOLOv8."""

    def __init__(self, path: str) -> None:
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        self.session = onnxruntime.InferenceSession(path, options, ["CPUExecutionProvider"])
        self.name = self.session.get_inputs()[0].name

    def run(self, blob: Pixels) -> Pixels:
        output: Pixels = self.session.run(None, {self.name: blob})[0]
        return output

    def detect(self, image: Pixels) -> tuple[Pixels, Pixels]:
        height, width = image.shape[:2]
        gain = min(SIDE / height, SIDE / width)
        new = (round(width * gain), round(height * gain))
        left, top = (SIDE - new[0]) // 2, (SIDE - new[1]) // 2
        border = (top, SIDE - new[1] - top, left, SIDE - new[0] - left)
        scaled = cv2.resize(image, new)
        padded = cv2.copyMakeBorder(scaled, *border, cv2.BORDER_CONSTANT, value=(114,) * 3)
        blob = cv2.dnn.blobFromImage(padded, 1 / 255, swapRB=True)
        rows = self.run(blob)[0].T
        classes, scores = rows[:, 4:].argmax(axis=1), rows[:, 4:].max(axis=1)
        good = scores > CHOICE.min_score
        rows, scores, classes = rows[good], scores[good], classes[good]
        corner = rows[:, :2] - rows[:, 2:4] / 2 + classes[:, None] * 10_000
        boxes = np.hstack([corner, rows[:, 2:4]])
        kept = cv2.dnn.NMSBoxes(boxes.tolist(), scores.tolist(), 0.25, CHOICE.max_overlap)
        return (rows[kept, :2] - (left, top)) / gain, scores[kept]


def milliseconds(work: Callable[[], object], rounds: int) -> float:
    """CPU time of one call, the median."""
    work()
    times = []
    for _ in range(rounds):
        started_ns = time.process_time_ns()
        work()
        times.append((time.process_time_ns() - started_ns) / 1e6)
    return statistics.median(times)


def measure(path: str, width: int, height: int, rounds: int) -> list[float | None]:
    """Milliseconds, as the table has them."""
    image = np.random.default_rng(2).integers(0, 256, (height, width, 3), np.uint8)
    network, plain = Network(path), PlainLoop(path)
    found = network.detect(image, "BGR", CHOICE)
    blob, to = network._blob, network.layout.preparation
    outputs = network._run(network._outputs)
    size = (blob.shape[3], blob.shape[2])
    run = milliseconds(lambda: plain.run(blob), rounds)
    ours = milliseconds(lambda: network.detect(image, "BGR", CHOICE), rounds)
    before = milliseconds(lambda: prepare(image, "BGR", to, blob), rounds)
    network._run = lambda *_: outputs  # type: ignore[method-assign]
    after = milliseconds(lambda: network.detect(image, "BGR", CHOICE), rounds) - before
    by_hand = None
    if "YOLOv8" in network.layout.name and size == (SIDE, SIDE):
        by_hand = milliseconds(lambda: plain.detect(image), rounds)
    print(f"  {width}x{height}: {network.layout.name}, {len(found)} things", flush=True)
    return [run, ours, before, after, by_hand]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("files", nargs="*", help="networks; none: a made one")
    parser.add_argument("--rounds", type=int, default=50, help="of each measurement")
    asked = parser.parse_args()
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory() as folder:
        files = asked.files or [made_network(str(Path(folder) / "made.onnx"))]
        rows = [
            (f"{Path(file).name} {width}x{height}", measure(file, width, height, asked.rounds))
            for file in files
            for width, height in ((640, 480), (1920, 1080))
        ]
    print("| network, image | run | ours | before | after | plain |\n|---|---|---|---|---|---|")
    for title, numbers in rows:
        cells = " | ".join("" if one is None else f"{one:.2f}" for one in numbers)
        print(f"| {title} | {cells} |")


if __name__ == "__main__":
    main()

"""Our network on a GPU beside the CPU: `python benchmarks/inference.py IMAGES... [--device cuda]`.

Speed by the size of a batch, the largest differences of the detections, and a server with several
processes that ask it, as in ``ros-visualise batch --device cuda``.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import statistics
import tempfile
import time
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ros_visualise.landmarks.networks import remote, session
from ros_visualise.landmarks.networks.batches import Room, run_together
from ros_visualise.landmarks.networks.candidates import SelectionRules
from ros_visualise.landmarks.networks.network import Network
from ros_visualise.landmarks.networks.preparation import Preparation, Resizing, prepare
from ros_visualise.landmarks.networks.serving import NetworkServer
from ros_visualise.landmarks.networks.session import OnnxSession, Provider

MODEL = Path(session.__file__).parent / "models" / "aerial.onnx"
NAMES = ["boxes", "scores", "classes", "points", "point_variances"]
SIDE = 640
CLOSE = 1e-3


def inputs_of(paths: Sequence[Path]) -> list[dict[str, Any]]:
    """Images as inputs of the network, each 640 pixels square."""
    found = []
    for path in paths:
        blob = np.zeros((1, 3, SIDE, SIDE), np.float32)
        prepare(cv2.imread(str(path)), "BGR", Preparation(Resizing.CENTER), blob)
        found.append({"images": blob})
    return found


def differences(expected: Sequence[Any], got: Sequence[Any], least: float) -> list[float]:
    """For each detection the larger difference, of the score or of the box as a fraction of the
    image, to the detection that is nearest; 1 if there is none."""
    found = []
    for one, other in zip(expected, got, strict=True):
        for box, score, kind in zip(one[0][0], one[1][0], one[2][0], strict=True):
            if score >= least:
                apart = np.abs(other[0][0] - box).max(axis=1, initial=0) / SIDE
                apart = np.maximum(apart, np.abs(other[1][0] - score))
                apart = np.where(other[2][0] == kind, apart, 1.0)
                found.append(float(apart.min(initial=1.0)))
    return found


def accuracy(inputs: Sequence[dict[str, Any]], device: Provider, batch: int) -> None:
    """Detections of the device, alone and in batches, beside those of the CPU."""
    there = opened(device)
    expected = [opened(Provider.CPU).run(one, NAMES) for one in inputs]
    alone = [there.run(one, NAMES) for one in inputs]
    batches = [inputs[at : at + batch] for at in range(0, len(inputs), batch)]
    together = [one for several in batches for one in run_together(there, several, NAMES)]
    print(f"\n{len(inputs)} images, {device.value} beside the CPU\n")
    print("| | score at least | detections | within 1e-3 | median | largest difference |")
    print("|---|---|---|---|---|---|")
    for name, got in (("alone", alone), (f"batches of {batch}", together)):
        for least in (0.3, 0.6):
            apart = differences(expected, got, least)
            close = sum(one <= CLOSE for one in apart)
            middle, worst = statistics.median(apart), max(apart)
            print(f"| {name} | {least} | {len(apart)} | {close} | {middle:.1e} | {worst:.1e} |")


@cache
def opened(device: Provider) -> OnnxSession:
    """Our network on a device, with all threads."""
    return OnnxSession(str(MODEL), device, len(os.sched_getaffinity(0)))


def rate(
    network: OnnxSession, inputs: Sequence[dict[str, Any]], batch: int, least_s: float
) -> float:
    """Images a second, each copied to the device and its results back."""
    room: Room = {}
    for _ in range(2):
        run_together(network, inputs[:batch], NAMES, room)
    count, start_s = 0, time.perf_counter()
    while time.perf_counter() - start_s < least_s:
        first = count % max(1, len(inputs) - batch + 1)
        run_together(network, inputs[first : first + batch], NAMES, room)
        count += batch
    return count / (time.perf_counter() - start_s)


def speed(inputs: Sequence[dict[str, Any]], device: Provider, least_s: float) -> None:
    """Rates by the size of a batch."""
    there, many = opened(device), len(os.sched_getaffinity(0))
    print("\n| | images a second |\n|---|---|")
    print(f"| CPU, {many} threads | {rate(opened(Provider.CPU), inputs, 1, least_s):.0f} |")
    for batch in (1, 8, 16, 32):
        found = rate(there, inputs, min(batch, len(inputs)), least_s)
        print(f"| {device.value}, batches of {batch} | {found:.0f} |")


def _serve(address: remote.ServerAddress, device: Provider) -> None:
    NetworkServer(address, device, len(os.sched_getaffinity(0)), 0).serve()


def _ask(
    address: remote.ServerAddress | None, paths: Sequence[Path], end_s: float, counts: Any
) -> None:
    """Detect in images until a time, as a task does."""
    cv2.setNumThreads(1)
    if address:
        remote.use(address, print)
    network = Network(str(MODEL), Provider.CUDA if address else Provider.CPU)
    images = [cv2.imread(str(path)) for path in paths]
    count, start_s = 0, time.monotonic()
    while time.monotonic() < start_s + end_s:
        network.detect(images[count % len(images)], "BGR", SelectionRules(0.6))
        count += 1
    counts.put(count / (time.monotonic() - start_s))


def serving(paths: Sequence[Path], device: Provider, clients: int, least_s: float) -> None:
    """Processes that ask one server, and as many with a network each on one core."""
    context = multiprocessing.get_context("spawn")
    print(f"\n| {clients} processes, preparation included | images a second |\n|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        address = remote.ServerAddress(f"{folder}/socket", b"benchmark")
        server = context.Process(target=_serve, args=(address, device), daemon=True)
        server.start()
        for name, place in ((f"one server, {device.value}", address), ("each its own, CPU", None)):
            counts = context.Queue()
            started = [
                context.Process(target=_ask, args=(place, paths, least_s, counts), daemon=True)
                for _ in range(clients)
            ]
            for one in started:
                one.start()
            print(f"| {name} | {sum(counts.get(timeout=120) for _ in started):.0f} |", flush=True)
        server.kill()


def main() -> None:
    """All parts."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("images", type=Path, nargs="+")
    parser.add_argument("--device", choices=[one.value for one in Provider], default="cuda")
    parser.add_argument("--seconds", type=float, default=3.0, help="of each measurement")
    parser.add_argument("--clients", type=int, default=len(os.sched_getaffinity(0)))
    asked = parser.parse_args()
    device, inputs = Provider(asked.device), inputs_of(asked.images)
    accuracy(inputs, device, 16)
    speed(inputs, device, asked.seconds)
    serving(asked.images, device, asked.clients, asked.seconds)


if __name__ == "__main__":
    main()

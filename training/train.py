"""Train the network for aerial landmarks on pictures of the simulator, and write it as ONNX.

    python training/train.py OUT --minutes 90

Renders worlds into ``OUT/pictures`` while it trains on those that are there; every few minutes it
writes ``OUT/checkpoint.pt``. The same command again goes on. Then comes the second look, and
``OUT/aerial.onnx`` is written.
"""

from __future__ import annotations

import argparse
import copy
import math
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import torch
from dataset import Example, find_examples, make_batch, some_pictures
from export import save_second, write_onnx
from looks import collect
from loss import Truth, detection_loss
from network import Network, follow, make_grid, make_optimizer
from pictures import add_arguments
from processor import FORMAT, precision
from second import Second
from start import read_start, start_first, start_second
from torch import Tensor
from train_second import RATE, RATE_ON, SAY_S, some_parts, train_second

_FIRST_WORLDS = 3
_SAVE_S = 240.0
_RATE, _RATE_ON = 2e-3, 1e-3  # from nothing, and from a network that has learned
_DECAY = 0.03
_WARM = 0.01  # of the time
_WEIGHTS = 8.0, 1.0, 0.1
"""Of classes, boxes and points, such that classes move the shared layers most: they learn last."""
_EMPTY = 0.5
_MEASURED = 96  # pictures by which a network that goes on from a file is normalised
_CROP, _WHOLE_FROM = 192, 0.85
"""Most of the time it learns from parts of pictures, which takes a third of the time of a whole."""


class Trainer:
    """The network, its slow average, and the optimiser.

    Args:
        network: what is trained.
        minutes: how long it will train; the learning rate falls to zero by then.
        rate: the highest learning rate.
        steps: that it was trained before.
    """

    def __init__(
        self,
        network: Network,
        classes: tuple[str, ...],
        minutes: float,
        seed: int,
        rate: float = _RATE,
        steps: int = 0,
    ) -> None:
        self.classes, self.minutes, self.seed, self.rate = classes, minutes, seed, rate
        self.network = network.to(memory_format=FORMAT)
        self.average = copy.deepcopy(self.network).eval().requires_grad_(False)
        self.optimizer = make_optimizer(self.network, _DECAY)
        self.steps, self.seconds = steps, 0.0
        self._grids: dict[tuple[int, int], tuple[Tensor, Tensor]] = {}

    def step(self, pictures: Tensor, truths: list[Truth]) -> list[float]:
        """Learn from one batch; its losses of classes, boxes and points."""
        start = time.monotonic()
        for group in self.optimizer.param_groups:
            group["lr"] = self._rate()
        size = (pictures.shape[2], pictures.shape[3])
        grid = self._grids.setdefault(size, make_grid(*size))
        with precision():
            raw = self.network(pictures)
        losses = detection_loss(raw, truths, grid, len(self.classes))
        total = sum(weight * loss for weight, loss in zip(_WEIGHTS, losses, strict=True))
        self.optimizer.zero_grad()
        total.backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), 10.0)
        self.optimizer.step()
        self.steps += 1
        follow(self.average, self.network, self.steps)
        self.seconds += time.monotonic() - start
        return [each.item() for each in losses]

    @property
    def done(self) -> float:
        """The share of the time that is over, 0 to 1."""
        return min(self.seconds / 60 / self.minutes, 1.0)

    def save(self, path: Path) -> None:
        """Write all that is needed to go on."""
        state = {name: getattr(self, name).state_dict() for name in _PARTS}
        state |= {"steps": self.steps, "seconds": self.seconds}
        state |= {"classes": self.classes, "width": self.network.width, "seed": self.seed}
        fresh = path.with_suffix(".new")
        torch.save(state, fresh)
        fresh.replace(path)

    def load(self, path: Path) -> None:
        """Go on from a checkpoint."""
        state = torch.load(path)
        for name in _PARTS:
            getattr(self, name).load_state_dict(state[name])
        self.steps, self.seconds = state["steps"], state["seconds"]

    def _rate(self) -> float:
        fall = 0.5 * (1 + math.cos(math.pi * self.done))
        return self.rate * min(1.0, self.done / _WARM + 0.01) * max(fall, 0.005)


_PARTS = "network", "average", "optimizer"


def start_rendering(out: Path, asked: argparse.Namespace) -> subprocess.Popen[bytes]:
    """Render worlds in a process of its own, if there are not enough of them yet."""
    command = [sys.executable, str(Path(__file__).with_name("pictures.py")), str(out / "pictures")]
    command += ["--worlds", str(asked.worlds), "--seed", str(asked.seed)]
    for path in asked.body:
        command += ["--body", str(path)]
    return subprocess.Popen(command)


def wait_for_pictures(folder: Path, rendering: subprocess.Popen[bytes]) -> tuple[str, ...]:
    """Wait until the first worlds are whole; the names of the classes."""
    while len(list(folder.glob("*/labels.json"))) < _FIRST_WORLDS and rendering.poll() is None:
        time.sleep(1)
    classes = find_examples(folder)[1]
    if not classes:
        raise SystemExit(f"no pictures in {folder}: see what the rendering said above")
    return classes


def make_trainer(classes: tuple[str, ...], folder: Path, asked: argparse.Namespace) -> Trainer:
    """The trainer of a fresh network, or of one that goes on from a file."""
    if asked.start is None:
        return Trainer(Network(len(classes), asked.width), classes, asked.minutes, asked.seed)
    start = read_start(asked.start)
    network = Network(len(classes), start.widths[0])
    examples = _shuffled(folder, np.random.default_rng(asked.seed))
    pictures, _ = make_batch(examples, _MEASURED, np.random.default_rng(asked.seed), _CROP)
    start_first(network, start, classes, pictures)
    return Trainer(network, classes, asked.minutes, asked.seed, _RATE_ON, start.steps)


def train(trainer: Trainer, folder: Path, out: Path, asked: argparse.Namespace) -> None:
    """Train until the time is over."""
    random = np.random.default_rng((asked.seed, trainer.steps))
    sums, count, said, saved = np.zeros(3), 0, time.monotonic(), time.monotonic()
    examples = _shuffled(folder, random)
    with ThreadPoolExecutor(1) as pool:
        upcoming = None
        while trainer.done < 1:
            crop = _CROP if trainer.done < _WHOLE_FROM else 0
            batch = pool.submit(make_batch, examples, asked.batch, random, crop)
            ready, upcoming = upcoming, batch
            if ready is None:
                continue
            sums, count = sums + trainer.step(*ready.result()), count + 1
            if time.monotonic() - said > SAY_S:
                _say(trainer, sums / count)
                sums, count, said = np.zeros(3), 0, time.monotonic()
            if time.monotonic() - saved > _SAVE_S:
                trainer.save(out / "checkpoint.pt")
                saved = time.monotonic()
    trainer.save(out / "checkpoint.pt")


def _shuffled(folder: Path, random: np.random.Generator) -> Iterator[Example]:
    """All pictures that are there by then, again and again; of those without a landmark half."""
    queue: list[Example] = []
    while True:
        before, queue = len(queue), find_examples(folder)[0]
        if len(queue) != before:
            print(f"{len(queue)} pictures", flush=True)
        for number in random.permutation(len(queue)):
            if len(queue[number].rows) or random.random() < _EMPTY:
                yield queue[number]


def _say(trainer: Trainer, losses: np.ndarray) -> None:
    names = ("classes", "boxes", "points")
    text = ", ".join(f"{name} {each:.3f}" for name, each in zip(names, losses, strict=True))
    print(f"{100 * trainer.done:.0f}%, step {trainer.steps}: loss of {text}", flush=True)


def look_again(trainer: Trainer, folder: Path, out: Path, asked: argparse.Namespace) -> None:
    """Train the second look, and write the network."""
    looks = collect(trainer.average, folder, asked.seed)
    count, seed = len(trainer.classes), asked.seed
    if asked.start is None:
        second, rate = Second(count, asked.second_width), RATE
    else:
        start = read_start(asked.start)
        second, rate = Second(count, start.widths[1]), RATE_ON
        start_second(second, start, trainer.classes, some_parts(looks, seed))
    second = train_second(second, looks, asked.second_minutes, seed, rate)
    save_second(second, out / "second.pt")
    about = {"seed": str(asked.seed), "steps": str(trainer.steps)}
    pictures = some_pictures(folder, asked.seed)
    write_onnx(trainer.average, second, trainer.classes, out / "aerial.onnx", about, pictures)


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path, help="folder for pictures, checkpoints and the network")
    parser.add_argument("--minutes", type=float, default=90, help="default: %(default)s")
    parser.add_argument("--second-minutes", type=float, default=40, help="default: %(default)s")
    parser.add_argument("--worlds", type=int, default=200, help="default: %(default)s")
    parser.add_argument("--batch", type=int, default=24, help="default: %(default)s")
    fresh = "channels; with --start, those of the file count (default: %(default)s)"
    parser.add_argument("--width", type=int, default=16, help=fresh)
    parser.add_argument("--second-width", type=int, default=24, help=fresh)
    parser.add_argument("--start", type=Path, help="ONNX file of such a network to go on from")
    parser.add_argument("--threads", type=int, default=1, help="of the processor")
    add_arguments(parser)
    asked = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that the rendering ends, too
    torch.set_num_threads(asked.threads)
    torch.manual_seed(asked.seed)
    asked.out.mkdir(parents=True, exist_ok=True)
    rendering = start_rendering(asked.out, asked)
    try:
        folder = asked.out / "pictures"
        trainer = make_trainer(wait_for_pictures(folder, rendering), folder, asked)
        if (asked.out / "checkpoint.pt").exists():
            trainer.load(asked.out / "checkpoint.pt")
        train(trainer, folder, asked.out, asked)
        rendering.wait()
        look_again(trainer, folder, asked.out, asked)
    finally:
        rendering.terminate()
        rendering.wait()
    return 0


if __name__ == "__main__":
    sys.exit(main())

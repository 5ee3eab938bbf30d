"""Train the network for aerial landmarks on pictures of the simulator, and write it as ONNX.

    python training/train.py OUT --minutes 90

Renders worlds into ``OUT/pictures`` while it trains on those that are there; every few minutes it
writes ``OUT/checkpoint.pt``. The same command again continues. Then it trains the refinement head,
and writes ``OUT/aerial.onnx``.
"""

from __future__ import annotations

import argparse
import copy
import math
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import advice  # noqa: F401
import torch
from dataset import make_batch
from device import DEVICE, FORMAT, Random, precision
from export import save_second, write_onnx
from looks import collect
from loss import Truth, detection_loss
from network import Network, follow, grid_of, make_optimizer
from pictures import add_arguments
from running import run
from second import Second
from start import read_start, start_first, start_second
from store import Store, some_pictures
from torch import Tensor
from train_second import BATCH, RATE, RATE_ON, SAY_S, Length, some_parts, train_second

from ros_visualise.core.errors import OpenError

_FIRST_WORLDS = 3
_BATCH = 24  # pictures, for which the rates are
_LARGER = 1 if DEVICE.type == "cpu" else 8  # batches of a graphics card
_SAVE_S, _REFRESH_S = 240.0, 5.0
_RATE, _RATE_ON = 2e-3, 1e-3  # from nothing, and from a network that has learned
_DECAY = 0.03
_WARM = 0.01  # of the time
_WEIGHTS = 8.0, 1.0, 0.1
"""Weights of classes, boxes and points: classes dominate the shared layers, as they learn last."""
_MEASURED = 96  # pictures by which a network that goes on from a file is normalised
_CROP, _WHOLE_FROM = 192, 0.85
"""Most of the time it learns from parts of pictures, which takes a third of the time of a whole."""


class Trainer:
    """The network, its slow average, and the optimiser.

    Args:
        network: what is trained.
        length: how long it will train; the learning rate falls to zero by then.
        rate: the highest learning rate.
        steps: that it was trained before.
    """

    def __init__(
        self,
        network: Network,
        classes: tuple[str, ...],
        length: Length,
        seed: int,
        rate: float = _RATE,
        steps: int = 0,
    ) -> None:
        self.classes, self.length, self.seed, self.rate = classes, length, seed, rate
        self.network = network.to(DEVICE, memory_format=FORMAT)
        self.average = copy.deepcopy(self.network).eval().requires_grad_(False)
        self.optimizer = make_optimizer(self.network, _DECAY)
        self.steps, self.seconds, self._before = steps, 0.0, steps

    def step(self, pictures: Tensor, truth: Truth) -> Tensor:
        """Learn from one batch; its losses of classes, boxes and points, (3,)."""
        for group in self.optimizer.param_groups:
            group["lr"] = self._rate()
        with precision():
            raw = self.network(pictures)
        losses = torch.stack(detection_loss(raw, truth, grid_of(pictures), len(self.classes)))
        self.optimizer.zero_grad()
        (torch.tensor(_WEIGHTS, device=DEVICE) * losses).sum().backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), 10.0)
        self.optimizer.step()
        self.steps += 1
        follow(self.average, self.network, self.steps)
        return losses.detach()

    @property
    def done(self) -> float:
        """The share that is over, 0 to 1."""
        return self.length.done(self.seconds, self.steps - self._before)

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
        state = torch.load(path, "cpu")
        if tuple(state["classes"]) != self.classes:
            told = (
                f"of {', '.join(state['classes'])}, and the pictures of {', '.join(self.classes)}"
            )
            raise OpenError(f"{path}: is {told}: give a folder of its own, or remove the file")
        for name in _PARTS:
            getattr(self, name).load_state_dict(state[name])
        self.steps, self.seconds = state["steps"], state["seconds"]

    def _rate(self) -> float:
        fall = 0.5 * (1 + math.cos(math.pi * self.done))
        return self.rate * min(1.0, self.done / _WARM + 0.01) * max(fall, 0.005)


_PARTS = "network", "average", "optimizer"


def start_rendering(out: Path, asked: argparse.Namespace) -> list[subprocess.Popen[bytes]]:
    """Render the worlds that are not there yet, in processes of their own."""
    processes = min(asked.processes, asked.worlds)
    return [
        subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("pictures.py")), str(out / "pictures")]
            + ["--first", str(first), "--worlds", str(asked.worlds - first)]
            + ["--step", str(processes), "--seed", str(asked.seed)]
            + ["--per-world", str(asked.per_world)]
            + [word for path in asked.body for word in ("--body", str(path))]
        )
        for first in range(processes)
    ]


def stop(rendering: list[subprocess.Popen[bytes]]) -> None:
    """End what still renders."""
    for each in rendering:
        each.terminate()
    for each in rendering:
        each.wait()


def wait_for_pictures(store: Store, rendering: list[subprocess.Popen[bytes]], all_: bool) -> None:
    """Wait until the first worlds are whole, or all, so that their order is always the same."""
    for each in rendering if all_ else []:
        each.wait()
    while store.refresh() < _FIRST_WORLDS and any(each.poll() is None for each in rendering):
        time.sleep(1)
    if not store.count:
        raise OpenError(f"no pictures in {store.folder}: see what the rendering said above")


def make_trainer(store: Store, asked: argparse.Namespace) -> Trainer:
    """The trainer of a fresh network, or of one that goes on from a file."""
    classes, more = store.classes, math.sqrt(asked.batch / _BATCH)
    length = Length(asked.minutes, asked.steps)
    if asked.start is None:
        network = Network(len(classes), asked.width)
        return Trainer(network, classes, length, asked.seed, more * _RATE)
    start = read_start(asked.start)
    network = Network(len(classes), start.widths[0])
    pictures, _ = make_batch(store, _MEASURED, Random(asked.seed, 1), _CROP)
    start_first(network, start, classes, pictures.cpu())
    return Trainer(network, classes, length, asked.seed, more * _RATE_ON, start.steps)


def train(trainer: Trainer, store: Store, out: Path, asked: argparse.Namespace) -> None:
    """Train until the time is over; worlds that become whole meanwhile are taken in."""
    random, before = Random(asked.seed, trainer.steps), trainer.seconds
    sums, count = torch.zeros(3, device=DEVICE), 0
    start = said = saved = refreshed = time.monotonic()
    with ExitStack() as stack:
        stack.callback(trainer.save, out / "checkpoint.pt")  # when it is broken off, too
        batches, worlds = (stack.enter_context(ThreadPoolExecutor(1)) for _ in range(2))
        upcoming = batches.submit(make_batch, store, asked.batch, random, _CROP)
        refreshing = worlds.submit(store.refresh)
        while trainer.done < 1:
            crop = _CROP if trainer.done < _WHOLE_FROM else 0
            ready = upcoming.result()
            upcoming = batches.submit(make_batch, store, asked.batch, random, crop)
            sums, count = sums + trainer.step(*ready), count + 1
            now = time.monotonic()
            trainer.seconds = before + now - start
            if refreshing.done() and now - refreshed > _REFRESH_S:
                refreshing.result()
                refreshing, refreshed = worlds.submit(store.refresh), now
            if now - said > SAY_S:
                _say(trainer, store, (sums / count).tolist())
                sums, count, said = torch.zeros_like(sums), 0, now
            if now - saved > _SAVE_S:
                trainer.save(out / "checkpoint.pt")
                saved = now


def _say(trainer: Trainer, store: Store, losses: list[float]) -> None:
    names = ("classes", "boxes", "points")
    text = ", ".join(f"{name} {each:.3f}" for name, each in zip(names, losses, strict=True))
    done = f"{100 * trainer.done:.0f}%, {store.count} pictures"
    print(f"{done}, step {trainer.steps}: loss of {text}", flush=True)


def look_again(trainer: Trainer, store: Store, out: Path, asked: argparse.Namespace) -> None:
    """Train the refinement head, and write the network."""
    looks = collect(trainer.average, store, Random(asked.seed, 2))
    print(f"refinement head: {len(looks.labels)} parts", flush=True)
    if not (looks.labels >= 0).any():
        raise OpenError("there is no landmark in the pictures: ask for more --worlds")
    random, count = Random(asked.seed, 3), len(trainer.classes)
    if asked.start is None:
        second, rate = Second(count, asked.second_width), RATE
    else:
        start = read_start(asked.start)
        second, rate = Second(count, start.widths[1]), RATE_ON
        start_second(second, start, trainer.classes, some_parts(looks, store, random))
    rate *= math.sqrt(asked.second_batch / BATCH)
    length = Length(asked.second_minutes, asked.second_steps)
    second = train_second(second, looks, store, length, random, rate, asked.second_batch)
    save_second(second, out / "second.pt")
    about = {"seed": str(asked.seed), "steps": str(trainer.steps)}
    pictures = some_pictures(store.folder, asked.seed)
    write_onnx(trainer.average, second, trainer.classes, out / "aerial.onnx", about, pictures)


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path, help="folder for pictures, checkpoints and the network")
    minutes = "default: %(default)s; 0: no limit but that of the steps"
    parser.add_argument("--minutes", type=float, default=90, help=minutes)
    parser.add_argument("--second-minutes", type=float, default=40, help=minutes)
    steps = "at most so many, begun when all worlds are there: with no minutes, repeatable"
    parser.add_argument("--steps", type=int, default=0, help=steps)
    parser.add_argument("--second-steps", type=int, default=0, help="at most so many")
    parser.add_argument("--worlds", type=int, default=200, help="default: %(default)s")
    many = "%(default)s pictures are learned from in one step"
    parser.add_argument("--batch", type=int, default=_LARGER * _BATCH, help=many)
    parts = "%(default)s crops in one step of the refinement head"
    parser.add_argument("--second-batch", type=int, default=_LARGER * BATCH, help=parts)
    fresh = "channels; with --start, those of the file count (default: %(default)s)"
    parser.add_argument("--width", type=int, default=16, help=fresh)
    parser.add_argument("--second-width", type=int, default=24, help=fresh)
    parser.add_argument("--start", type=Path, help="ONNX file of such a network to go on from")
    threads = "of the processor, for each step (default: %(default)s)"
    parser.add_argument("--threads", type=int, default=1, help=threads)
    cores = max((os.cpu_count() or 1) - 1, 1)
    renderers = "that render worlds (default: all cores but one, %(default)s)"
    parser.add_argument("--processes", type=int, default=cores, help=renderers)
    add_arguments(parser)
    asked = parser.parse_args()
    if asked.batch < 2 or asked.second_batch < 1 or asked.worlds < 0 or asked.processes < 1:
        parser.error("give --batch from 2, --second-batch and --processes from 1, --worlds from 0")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that the rendering ends, too
    torch.set_num_threads(asked.threads)
    torch.manual_seed(asked.seed)
    asked.out.mkdir(parents=True, exist_ok=True)
    rendering = start_rendering(asked.out, asked)
    try:
        store = Store(asked.out / "pictures", asked.worlds)
        wait_for_pictures(store, rendering, asked.steps > 0)
        trainer = make_trainer(store, asked)
        if (asked.out / "checkpoint.pt").exists():
            trainer.load(asked.out / "checkpoint.pt")
        train(trainer, store, asked.out, asked)
        for each in rendering:
            each.wait()
        if (there := store.refresh()) < store.room:
            print(f"only {there} of {store.room} worlds are there: see above why", flush=True)
        look_again(trainer, store, asked.out, asked)
    finally:
        stop(rendering)
    return 0


if __name__ == "__main__":
    run(main)

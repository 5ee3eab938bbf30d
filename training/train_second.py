"""Training of the refinement head on the proposals of the first network."""

from __future__ import annotations

import copy
import math
import time
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import torch
from device import DEVICE, FORMAT, Random, precision
from looks import NONE, Looks, Views, vary
from network import follow, make_optimizer
from second import Second, decode_parts
from store import Store
from torch import Tensor
from torch.nn import functional
from worlds import CLASSES

SAY_S = 15.0
"""Between two lines about the losses."""
BATCH = 128
"""Parts in one step."""
_OF_NONE, _OF_REAL = 0.25, 0.17  # of a batch, from rendered and from real pictures
"""The rest is shared alike by the classes."""
RATE, RATE_ON = 3e-3, 1.5e-3
"""The highest learning rates, from nothing and from a network that has learned."""
_DECAY = 0.05
_WARM = 0.01  # of the time
_MEASURED = 400  # parts by which a network that goes on from a file is normalised
_WEIGHTS = 1.0, 2.0, 0.1
"""Weights of classes, boxes and points."""
_FLAT = tuple(CLASSES.index(name) for name in ("helipad", "tag"))
_FAR = 2.0  # half sides; a ground point beyond is not looked for in this part


class Length(NamedTuple):
    """How long to train: so many minutes or steps, whichever ends first; 0 is no limit."""

    minutes: float
    steps: int = 0

    def done(self, seconds: float, steps: int) -> float:
        """The share that is over, 0 to 1."""
        pairs = (seconds / 60, self.minutes), (steps, self.steps)
        return min(max((now / limit for now, limit in pairs if limit), default=1.0), 1.0)


def some_parts(looks: Looks, store: Store, random: Random) -> tuple[Tensor, Tensor, Tensor]:
    """A few as `Second` takes them."""
    seen = vary(looks, store, random.index(len(looks.labels), _MEASURED), _FLAT, random)
    return seen.pixels.cpu(), seen.halves.cpu(), seen.shares.cpu()


def train_second(
    network: Second,
    looks: Looks,
    store: Store,
    length: Length,
    random: Random,
    highest: float = RATE,
    batch: int = BATCH,
) -> Second:
    """Train the refinement head; the slow average of the network.

    Args:
        highest: learning rate.
        batch: parts in one step.
    """
    network = network.to(DEVICE, memory_format=FORMAT)
    average = copy.deepcopy(network).eval().requires_grad_(False)
    optimizer = make_optimizer(network, _DECAY)
    groups = _groups(looks, store, network.classes, batch)
    weights = torch.tensor(_WEIGHTS, device=DEVICE)

    def make_batch() -> Views:
        chosen = torch.cat([group[random.index(len(group), some)] for group, some in groups])
        return vary(looks, store, chosen, _FLAT, random)

    sums, count, step = torch.zeros(3, device=DEVICE), 0, 0
    start = said = time.monotonic()
    with ThreadPoolExecutor(1) as batches:
        upcoming = batches.submit(make_batch)
        while (done := length.done(time.monotonic() - start, step)) < 1:
            rate = highest * min(1.0, done / _WARM + 0.01)
            for group in optimizer.param_groups:
                group["lr"] = rate * max((1 + math.cos(math.pi * done)) / 2, 0.003)
            seen, upcoming = upcoming.result(), batches.submit(make_batch)
            with precision():
                raw = network(seen.pixels, seen.halves, seen.shares)
            losses = torch.stack(second_loss(raw.float(), seen))
            optimizer.zero_grad()
            (weights * losses).sum().backward()
            optimizer.step()
            step += 1
            follow(average, network, step)
            sums, count = sums + losses.detach(), count + 1
            if time.monotonic() - said > SAY_S:
                told = ", ".join(f"{each:.3f}" for each in (sums / count).tolist())
                print(f"refinement head: {100 * done:.0f}%, step {step}: losses {told}", flush=True)
                sums, count, said = torch.zeros_like(sums), 0, time.monotonic()
    return average


def second_loss(raw: Tensor, seen: Views) -> tuple[Tensor, Tensor, Tensor]:
    """The losses of classes, boxes and points; ``raw`` as `Second` gives it."""
    classes, labels, wanted = raw.shape[1] - 9, seen.labels, seen.wanted
    kinds = torch.where(labels == NONE, classes, labels)
    of_class = functional.cross_entropy(raw[:, : classes + 1], kinds, label_smoothing=0.02)
    there = labels != NONE
    boxes, points, spread = decode_parts(raw[there, classes + 1 :], seen.shares[there])
    of_box = functional.smooth_l1_loss(boxes, wanted[there, :4].clamp(-1.6, 1.6), beta=0.05)
    gap = wanted[there, 4:] - points
    near = (wanted[there, 4:].abs() < _FAR).all(dim=1, keepdim=True)
    nll = 0.5 * gap**2 * torch.exp(-2 * spread) + spread  # as in loss.py: beta-NLL
    of_point = (spread.detach().exp() * nll * near).sum(dim=1).clamp(max=20).mean()
    return of_class, of_box, of_point


def _groups(looks: Looks, store: Store, classes: int, batch: int) -> list[tuple[Tensor, int]]:
    """Crops by label, and the number of each in a batch."""
    none, real = looks.labels == NONE, store.real[looks.which]
    share = (1 - _OF_NONE - _OF_REAL) / classes
    kinds = [(none & ~real, _OF_NONE), (none & real, _OF_REAL)]
    kinds += [(looks.labels == kind, share) for kind in range(classes)]
    groups = [(torch.nonzero(chosen)[:, 0], share) for chosen, share in kinds]
    return [(group, max(1, round(share * batch))) for group, share in groups if len(group)]

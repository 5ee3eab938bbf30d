"""Train the second look on what the first network proposes."""

from __future__ import annotations

import copy
import math
import time

import numpy as np
import numpy.typing as npt
import torch
from looks import NONE, Looks, vary
from network import follow, make_optimizer
from processor import FORMAT, precision
from second import Second, decode_parts
from torch import Tensor
from torch.nn import functional
from worlds import CLASSES

SAY_S = 15.0
"""Between two lines about the losses."""
_BATCH = 128
_OF_NONE = 0.42  # of a batch; the rest is shared alike by the classes
RATE, RATE_ON = 3e-3, 1.5e-3
"""The highest learning rates, from nothing and from a network that has learned."""
_DECAY = 0.05
_WARM = 0.01  # of the time
_MEASURED = 400  # parts by which a network that goes on from a file is normalised
_WEIGHTS = 1.0, 2.0, 0.1
"""Of classes, boxes and points."""
_FLAT = tuple(CLASSES.index(name) for name in ("helipad", "tag"))
_FAR = 2.0  # half sides; a ground point beyond is not looked for in this part


def some_parts(looks: Looks, seed: int) -> tuple[Tensor, Tensor, Tensor]:
    """A few as `Second` takes them."""
    random = np.random.default_rng(seed)
    pixels, halves, shares, *_ = vary(
        looks, random.integers(0, len(looks.labels), _MEASURED), _FLAT, random
    )
    return pixels, halves, shares


def train_second(
    network: Second, looks: Looks, minutes: float, seed: int, highest: float = RATE
) -> Second:
    """Train for so many minutes of the processor's time; the slow average of the network.

    Args:
        highest: learning rate.
    """
    random = np.random.default_rng((seed, 2))
    network = network.to(memory_format=FORMAT)
    average = copy.deepcopy(network).eval().requires_grad_(False)
    optimizer = make_optimizer(network, _DECAY)
    groups = _groups(looks, network.classes)
    sums, step, start, said = np.zeros(4), 0, time.process_time(), time.monotonic()
    while (done := (time.process_time() - start) / 60 / minutes) < 1:
        rate = highest * min(1.0, done / _WARM + 0.01)
        for group in optimizer.param_groups:
            group["lr"] = rate * max((1 + math.cos(math.pi * done)) / 2, 0.003)
        chosen = np.concatenate([random.choice(group, count) for group, count in groups])
        pixels, halves, shares, labels, wanted = vary(looks, chosen, _FLAT, random)
        with precision():
            raw = network(pixels, halves, shares)
        losses = second_loss(raw.float(), shares, labels, wanted)
        optimizer.zero_grad()
        sum(weight * loss for weight, loss in zip(_WEIGHTS, losses, strict=True)).backward()
        optimizer.step()
        step += 1
        follow(average, network, step)
        sums += [*(each.item() for each in losses), 1]
        if time.monotonic() - said > SAY_S:
            told = ", ".join(f"{each:.3f}" for each in sums[:3] / sums[3])
            print(f"second look: {100 * done:.0f}%, step {step}: losses {told}", flush=True)
            sums[:], said = 0, time.monotonic()
    return average


def second_loss(
    raw: Tensor, shares: Tensor, labels: Tensor, wanted: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """The losses of classes, boxes and points; arguments as `Second` and `looks.vary` give them."""
    classes = raw.shape[1] - 9
    kinds = torch.where(labels == NONE, torch.full_like(labels, classes), labels)
    of_class = functional.cross_entropy(raw[:, : classes + 1], kinds, label_smoothing=0.02)
    there = labels != NONE
    boxes, points, spread = decode_parts(raw[there, classes + 1 :], shares[there])
    of_box = functional.smooth_l1_loss(boxes, wanted[there, :4].clamp(-1.6, 1.6), beta=0.05)
    gap = wanted[there, 4:] - points
    near = (wanted[there, 4:].abs() < _FAR).all(dim=1, keepdim=True)
    nll = 0.5 * gap**2 * torch.exp(-2 * spread) + spread  # as in loss.py: beta-NLL
    of_point = (spread.detach().exp() * nll * near).sum(dim=1).clamp(max=20).mean()
    return of_class, of_box, of_point


def _groups(looks: Looks, classes: int) -> list[tuple[npt.NDArray[np.intp], int]]:
    """The parts of each label that there is, and how many of them a batch has."""
    shares = {NONE: _OF_NONE, **dict.fromkeys(range(classes), (1 - _OF_NONE) / classes)}
    found = []
    for label, share in shares.items():
        group = np.flatnonzero(looks.labels == label)
        if len(group):
            found.append((group, max(1, round(share * _BATCH))))
    return found

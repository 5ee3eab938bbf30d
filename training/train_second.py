"""Train the second look on what the first network proposes."""

from __future__ import annotations

import copy
import math
import time

import numpy as np
import numpy.typing as npt
import torch
from looks import NONE, Looks, vary
from network import follow
from second import Second, decode_parts
from torch import Tensor
from torch.nn import functional
from worlds import CLASSES

SAY_S = 15.0
"""Between two lines about the losses."""
_BATCH = 128
_OF_NONE = 0.42  # of a batch
_OF_FIRST = 0.25
"""Of a batch, the helipads: what tells them from signs is learned last."""
_RATE, _DECAY, _WARM = 3e-3, 0.05, 200
_WEIGHTS = 1.0, 2.0, 0.1
"""Of classes, boxes and points."""
_FLAT = tuple(CLASSES.index(name) for name in ("helipad", "tag"))
_FAR = 2.0  # half sides; a ground point beyond is not looked for in this part


def train_second(looks: Looks, classes: int, width: int, minutes: float, seed: int) -> Second:
    """Train for so many minutes of the processor's time; the slow average of the network."""
    random = np.random.default_rng((seed, 2))
    network = Second(classes, width).to(memory_format=torch.channels_last)
    average = copy.deepcopy(network).eval().requires_grad_(False)
    optimizer = torch.optim.AdamW(network.parameters(), _RATE, weight_decay=_DECAY)
    groups = _groups(looks, classes)
    sums, step, start, said = np.zeros(4), 0, time.process_time(), time.monotonic()
    while (done := (time.process_time() - start) / 60 / minutes) < 1:
        rate = _RATE * min(1.0, (step + 1) / _WARM)
        optimizer.param_groups[0]["lr"] = rate * max((1 + math.cos(math.pi * done)) / 2, 0.003)
        chosen = np.concatenate([random.choice(group, count) for group, count in groups])
        pixels, halves, shares, labels, wanted = vary(looks, chosen, _FLAT, random)
        with torch.autocast("cpu", dtype=torch.bfloat16):
            raw = network(pixels, halves, shares)
        losses = second_loss(raw.float(), shares, labels, wanted)
        optimizer.zero_grad()
        sum(weight * loss for weight, loss in zip(_WEIGHTS, losses, strict=True)).backward()
        optimizer.step()
        step += 1
        follow(average, network, step)
        sums += [*(float(each) for each in losses), 1]
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
    rest = (1 - _OF_NONE - _OF_FIRST) / max(classes - 1, 1)
    shares = {NONE: _OF_NONE, **{kind: rest if kind else _OF_FIRST for kind in range(classes)}}
    found = []
    for label, share in shares.items():
        group = np.flatnonzero(looks.labels == label)
        if len(group):
            found.append((group, max(1, round(share * _BATCH))))
    return found

"""Which cells answer for which landmark, and how wrong they are.

Source: Feng et al., TOOD, 2021 (assignment by score and overlap); Li et al., Generalized Focal
Loss, 2020 (scores that mean overlap); Seitzer et al., 2022 (beta-NLL for the ground point).
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from network import decode
from torch import Tensor
from torch.nn import functional

_REACH = {8.0: (0.0, 96.0), 16.0: (40.0, 224.0), 32.0: (96.0, 1e9)}
"""Stride -> how large the landmarks are that its cells answer for: the root of the box, pixels."""
_CELLS = 10


class Truth(NamedTuple):
    """The landmarks of one picture: (n,) classes, (n, 4) boxes, (n, 2) points, (n,) bool."""

    kinds: Tensor
    boxes: Tensor
    points: Tensor
    ignored: Tensor


def detection_loss(
    raw: Tensor, truths: list[Truth], grid: tuple[Tensor, Tensor], classes: int
) -> tuple[Tensor, Tensor, Tensor]:
    """The losses of classes, boxes and points of a batch, each by the sum of what is assigned."""
    logits = raw[..., :classes].float()
    boxes, points, spread = decode(raw[..., classes:].float(), *grid)
    wanted, weight = torch.zeros_like(logits), torch.ones_like(logits[..., :1])
    of_box, of_point = [], []
    for number, truth in enumerate(truths):
        score = logits[number].detach().sigmoid()
        cells, things, quality = assign(score, boxes[number].detach(), truth, grid)
        wanted[number, cells, truth.kinds[things]] = quality
        weight[number, _inside(grid[0], truth.boxes[truth.ignored]).any(dim=1)] = 0
        weight[number, cells] = 1
        of_box.append(quality * (1 - giou(boxes[number, cells], truth.boxes[things])))
        gap = (points[number, cells] - truth.points[things]) / grid[1][cells]
        of_point.append(quality * _point_loss(gap, spread[number, cells] - grid[1][cells].log()))
    focus = (logits.sigmoid() - wanted).abs().pow(2).detach() * weight
    cost = functional.binary_cross_entropy_with_logits(logits, wanted, reduction="none")
    total = wanted.sum().clamp(min=1)
    return (
        (focus * cost).sum() / total,
        torch.cat(of_box).sum() / total,
        (torch.cat(of_point).sum() / total),
    )


def assign(
    score: Tensor, boxes: Tensor, truth: Truth, grid: tuple[Tensor, Tensor]
) -> tuple[Tensor, Tensor, Tensor]:
    """Cells, the landmark that each answers for, and the score in 0 to 1 that it should give."""
    things = torch.nonzero(~truth.ignored)[:, 0]
    none = torch.zeros(0, dtype=torch.long)
    if len(things) == 0:
        return none, none, torch.zeros(0)
    centres, strides = grid
    target = truth.boxes[things]
    overlap = iou(boxes[:, None], target[None]).clamp(min=1e-3)
    fit = score[:, truth.kinds[things]] * overlap**4
    fit = torch.where(_candidates(centres, strides, target), fit + 1e-12, torch.zeros_like(fit))
    best, cells = fit.topk(min(_CELLS, len(fit)), dim=0)
    chosen = torch.zeros_like(fit).scatter(0, cells, best)
    value, own = chosen.max(dim=1)
    taken = torch.nonzero(value > 0)[:, 0]
    own = own[taken]
    top_fit, top_overlap = chosen.amax(dim=0), torch.where(chosen > 0, overlap, 0 * fit).amax(dim=0)
    quality = value[taken] / top_fit[own] * top_overlap[own]
    return taken, things[own], quality.clamp(min=0.02)


def _candidates(centres: Tensor, strides: Tensor, target: Tensor) -> Tensor:
    """(cells, n): the cells within a box of the fitting size, or close to its middle."""
    side = (target[:, 2:] - target[:, :2]).prod(dim=1).sqrt()
    fits = torch.zeros(len(centres), len(target), dtype=torch.bool)
    for stride, (low, high) in _REACH.items():
        fits |= (strides == stride) & (side >= low) & (side <= high)
    middle = (target[:, :2] + target[:, 2:]) / 2
    close = (centres[:, None] - middle[None]).abs().amax(dim=2) < strides * 0.8
    return fits & (close | _inside(centres, target))


def _inside(centres: Tensor, boxes: Tensor) -> Tensor:
    at = centres[:, None]
    return ((at > boxes[None, :, :2]) & (at < boxes[None, :, 2:])).all(dim=2)


def _point_loss(gap: Tensor, spread: Tensor) -> Tensor:
    """Gaussian negative log likelihood, weighted so that what is uncertain still learns."""
    nll = 0.5 * gap**2 * torch.exp(-2 * spread) + spread
    return (spread.detach().exp() * nll).sum(dim=1).clamp(max=50)


def iou(a: Tensor, b: Tensor) -> Tensor:
    """Intersection over union of boxes x0 y0 x1 y1, with broadcasting."""
    both = _area(torch.maximum(a[..., :2], b[..., :2]), torch.minimum(a[..., 2:], b[..., 2:]))
    whole = _area(a[..., :2], a[..., 2:]) + _area(b[..., :2], b[..., 2:]) - both
    return both / whole.clamp(min=1e-6)


def giou(a: Tensor, b: Tensor) -> Tensor:
    """Generalised intersection over union. Source: Rezatofighi et al., 2019."""
    both = _area(torch.maximum(a[..., :2], b[..., :2]), torch.minimum(a[..., 2:], b[..., 2:]))
    whole = _area(a[..., :2], a[..., 2:]) + _area(b[..., :2], b[..., 2:]) - both
    hull = _area(torch.minimum(a[..., :2], b[..., :2]), torch.maximum(a[..., 2:], b[..., 2:]))
    return both / whole.clamp(min=1e-6) - (hull - whole) / hull.clamp(min=1e-6)


def _area(low: Tensor, high: Tensor) -> Tensor:
    side = (high - low).clamp(min=0)
    return side[..., 0] * side[..., 1]

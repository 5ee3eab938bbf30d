"""Assignment of cells to landmarks, and the loss.

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
    """The landmarks of B pictures, at most n in each."""

    kinds: Tensor
    """(B, n) classes; -1 for padding."""
    boxes: Tensor
    """(B, n, 4)."""
    points: Tensor
    """(B, n, 2)."""
    ignored: Tensor
    """(B, n) bool; what is there is neither a landmark of its class nor none."""


class Taken(NamedTuple):
    """The M cells that answer for a landmark."""

    pictures: Tensor
    cells: Tensor
    things: Tensor
    """(M,) which landmark of the picture."""
    quality: Tensor
    """(M,) the score in 0 to 1 that the cell should give."""


def detection_loss(
    raw: Tensor, truth: Truth, grid: tuple[Tensor, Tensor], classes: int
) -> tuple[Tensor, Tensor, Tensor]:
    """The losses of classes, boxes and points of a batch, each by the sum of what is assigned."""
    logits = raw[..., :classes].float()
    boxes, points, spread = decode(raw[..., classes:].float(), *grid)
    taken = assign(logits.detach().sigmoid(), boxes.detach(), truth, grid)
    own, things, strides = taken[:2], (taken.pictures, taken.things), grid[1][taken.cells]
    wanted = torch.zeros_like(logits)
    wanted[(*own, truth.kinds[things])] = taken.quality
    hidden = _inside(grid[0], truth.boxes) & truth.ignored[:, None]  # (B, cells, n)
    of_kind = functional.one_hot(truth.kinds.clamp(min=0), classes).float()
    weight = 1 - (hidden.float() @ of_kind).clamp(max=1)
    weight[own] = 1
    focus = (logits.sigmoid() - wanted).abs().pow(2).detach() * weight
    cost = functional.binary_cross_entropy_with_logits(logits, wanted, reduction="none")
    of_box = taken.quality * (1 - giou(boxes[own], truth.boxes[things]))
    gap = (points[own] - truth.points[things]) / strides
    of_point = taken.quality * _point_loss(gap, spread[own] - strides.log())
    total = wanted.sum().clamp(min=1)
    return (focus * cost).sum() / total, of_box.sum() / total, of_point.sum() / total


def assign(score: Tensor, boxes: Tensor, truth: Truth, grid: tuple[Tensor, Tensor]) -> Taken:
    """Assign cells to landmarks.

    Args:
        score: (B, cells, classes).
        boxes: (B, cells, 4) predicted boxes.
    """
    overlap = iou(boxes[:, :, None], truth.boxes[:, None]).clamp(min=1e-3)  # (B, cells, n)
    kinds = truth.kinds.clamp(min=0)[:, None].expand(overlap.shape)
    fit = score.gather(2, kinds) * overlap**4 + 1e-12
    counted = (truth.kinds >= 0) & ~truth.ignored
    fit = torch.where(_candidates(*grid, truth.boxes) & counted[:, None], fit, 0 * fit)
    best, cells = fit.topk(min(_CELLS, fit.shape[1]), dim=1)
    chosen = torch.zeros_like(fit).scatter(1, cells, best)
    value, own = chosen.max(dim=2)
    taken = torch.nonzero(value > 0, as_tuple=True)
    things = own[taken]
    top_overlap = torch.where(chosen > 0, overlap, 0 * fit).amax(dim=1)[taken[0], things]
    quality = value[taken] / chosen.amax(dim=1)[taken[0], things] * top_overlap
    return Taken(*taken, things, quality.clamp(min=0.02))


def _candidates(centres: Tensor, strides: Tensor, target: Tensor) -> Tensor:
    """(B, cells, n): the cells within a box of the fitting size, or close to its middle."""
    side = (target[..., 2:] - target[..., :2]).clamp(min=0).prod(dim=2).sqrt()[:, None]
    fits = torch.zeros_like(side, dtype=torch.bool)
    for stride, (low, high) in _REACH.items():
        fits = fits | ((strides == stride) & (side >= low) & (side <= high))
    middle = (target[..., :2] + target[..., 2:]) / 2
    close = (centres[:, None] - middle[:, None]).abs().amax(dim=3) < strides * 0.8
    return fits & (close | _inside(centres, target))


def _inside(centres: Tensor, boxes: Tensor) -> Tensor:
    """(B, cells, n): which cells are in which box of (B, n, 4)."""
    at, boxes = centres[:, None], boxes[:, None]
    return ((at > boxes[..., :2]) & (at < boxes[..., 2:])).all(dim=3)


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

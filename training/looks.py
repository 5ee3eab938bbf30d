"""Training data of the refinement head: crops around the proposals of the first network."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import torch
from colours import Recolouring, recolour
from device import DEVICE, FORMAT, Random, precision
from loss import iou
from network import Network, decode, enlarge, grid_of, halve
from second import SIDE, WIDER, parts_about
from store import ABSENT, Store
from torch import Tensor

_LEAST_SCORE, _MOST, _OVERLAP = 0.05, 24, 0.6
"""Number of proposals per picture, and their largest overlap."""
_CELLS = 200  # of a picture, the best, among which these are chosen
_BATCH = 128
NONE, UNSURE = -1, -2
"""Labels of what is no landmark, and of what nobody could tell."""
_RIGHT, _WRONG = 0.3, 0.2
"""Overlaps with a landmark from which, and up to which, a box is one or none: what is right but
badly placed is placed anew."""
_LEAST_SHARE, _LEAST_PX = 0.4, 8.0
_SHIFT = 0.1  # of a true box's sides, of the parts about landmarks that are there in any case
_DOUBTFUL, _OF_DOUBTFUL = 0.2, 0.25  # of those with less score than that only so many are kept
_MOVED = 0.05  # of a part's half sides, by how much it is moved and scaled
_COLOURS = Recolouring(
    turned=0.5, contrast=0.6, gain=(0.65, 1.35), brightness=0.6, lift=0.12, inverted=0.05
)


class Looks(NamedTuple):
    """N boxes to look at: the numbers of their pictures, labels, boxes (N, 4) and what is true.

    ``truth`` (N, 6) is a box and a ground point, in pixels of the picture.
    """

    which: Tensor
    labels: Tensor
    boxes: Tensor
    truth: Tensor


class Views(NamedTuple):
    """Parts as they are looked at, and what is true of them."""

    pixels: Tensor
    """(B, CHANNELS, SIDE, SIDE)."""
    halves: Tensor
    shares: Tensor
    """Both as `Parts` has them."""
    labels: Tensor
    wanted: Tensor
    """(B, 6) box and ground point, from the part's middle, in half sides."""


def collect(network: Network, store: Store, random: Random) -> Looks:
    """Collect the training crops of all pictures."""
    network = network.to(DEVICE, memory_format=FORMAT).eval()
    found = []
    for start in range(0, store.count, _BATCH):
        which = torch.arange(start, min(start + _BATCH, store.count), device=DEVICE)
        at = torch.arange(store.side, device=DEVICE).float().expand(len(which), -1)
        pictures = store.cut(which, at, at, torch.zeros_like(which, dtype=torch.bool))
        boxes, scores = propose(network, pictures.permute(0, 3, 1, 2))
        found.append(_looks(which, store.rows[which], boxes, scores, random))
        if start % (40 * _BATCH) == 0:
            print(f"refinement head: {start} of {store.count} pictures", flush=True)
    return Looks(*(torch.cat(parts) for parts in zip(*found, strict=True)))


def propose(network: Network, pictures: Tensor) -> tuple[Tensor, Tensor]:
    """Boxes (B, n, 4) and scores (B, n) to learn from in pictures (B, 3, H, W); 0 where none is."""
    boxes, scores = _cells(network, pictures)
    large, surely = _cells(network, halve(pictures))
    return _choose(torch.cat([boxes, enlarge(large)], 1), torch.cat([scores, surely], 1))


def _cells(network: Network, pictures: Tensor) -> tuple[Tensor, Tensor]:
    """Boxes (B, cells, 4) and scores (B, cells)."""
    with torch.no_grad(), precision():
        raw = network(pictures.contiguous(memory_format=FORMAT)).float()
    boxes = decode(raw[..., network.classes :], *grid_of(pictures))[0]
    return boxes, raw[..., : network.classes].amax(dim=2).sigmoid()


def _choose(boxes: Tensor, scores: Tensor) -> tuple[Tensor, Tensor]:
    """The best ones, again and again, without those that overlap one of them: (B, _MOST, 4)."""
    scores, best = scores.topk(min(_CELLS, scores.shape[1]), dim=1)
    boxes = boxes.gather(1, best[..., None].expand(-1, -1, 4))
    scores = torch.where(scores > _LEAST_SCORE, scores, 0 * scores)
    number, chosen = torch.arange(len(boxes), device=DEVICE), []
    for _ in range(_MOST):
        score, at = scores.max(dim=1)
        box = boxes[number, at]
        chosen.append((box, score))
        scores = scores * (iou(boxes, box[:, None]) <= _OVERLAP)
        scores[number, at] = 0
    found, surely = zip(*chosen, strict=True)
    return torch.stack(found, dim=1), torch.stack(surely, dim=1)


def _looks(which: Tensor, rows: Tensor, boxes: Tensor, scores: Tensor, random: Random) -> Looks:
    """Proposals in pictures, and boxes around their landmarks."""
    sides = rows[..., 3:5] - rows[..., 1:3]
    seen = (rows[..., 7] >= _LEAST_SHARE) & (sides.amax(dim=2) >= _LEAST_PX)
    seen &= rows[..., 0] != ABSENT
    shift = random.normal(*rows.shape[:2], 4, deviation=_SHIFT)
    about = rows[..., 1:5] + shift * sides.repeat(1, 1, 2)
    good = seen & (about[..., 2:] > about[..., :2] + 2).all(dim=2)
    boxes, scores = torch.cat([boxes, about], dim=1), torch.cat([scores, good.float()], dim=1)
    labels, own = _labels(boxes, rows, seen)
    kept = (scores > _DOUBTFUL) | random.chance(_OF_DOUBTFUL, *scores.shape)
    kept = (scores > 0) & ((labels >= 0) | ((labels == NONE) & kept))
    truth = rows[..., 1:7].gather(1, own[..., None].expand(-1, -1, 6))
    pictures = which[:, None].expand(labels.shape)
    return Looks(pictures[kept], labels[kept], boxes[kept], truth[kept])


def _labels(boxes: Tensor, rows: Tensor, seen: Tensor) -> tuple[Tensor, Tensor]:
    """The class of each box, `NONE` or `UNSURE`, and the row of the landmark it is nearest to."""
    overlap = iou(boxes[:, :, None], rows[:, None, :, 1:5])
    overlap = torch.where(rows[:, None, :, 0] == ABSENT, 0 * overlap, overlap)
    overlap, own = overlap.max(dim=2)
    labels = torch.where(seen.gather(1, own), rows[..., 0].gather(1, own).long(), UNSURE)
    labels = torch.where(overlap < _RIGHT, UNSURE, labels)
    return torch.where(overlap < _WRONG, NONE, labels), own


def vary(
    looks: Looks, store: Store, chosen: Tensor, turning: Sequence[int], random: Random
) -> Views:
    """Parts moved, scaled, mirrored, turned, and in other colours.

    Args:
        chosen: (B,) numbers of the looks.
        turning: classes of what lies flat, so that no side of it is up.
    """
    which, labels, boxes, truth = (each[chosen] for each in looks)
    count = len(chosen)
    flat = (labels == NONE) & random.chance(0.6, count)
    for kind in turning:
        flat |= labels == kind
    mirrored = random.chance(0.5, count, 2)
    mirrored[:, 1] &= flat
    swapped = (flat & random.chance(0.5, count))[:, None]  # x for y
    middles, halves, shares = parts_about(_moved(boxes, random))
    reach = torch.where(mirrored, -halves, halves)
    pixels = torch.cat([_cut(store, which, middles, by * reach, by > 1) for by in (1.0, WIDER)], 3)
    pixels = torch.where(swapped[..., None, None], pixels.transpose(1, 2), pixels)
    pixels = recolour(pixels.permute(0, 3, 1, 2).contiguous(), _COLOURS, random)
    points = (truth.reshape(count, 3, 2) - middles[:, None]) / reach[:, None]
    corners = points[:, :2].sort(dim=1).values
    points = torch.cat([corners, points[:, 2:]], dim=1)
    points = torch.where(swapped[..., None], points.flip(2), points).flatten(1)
    halves, shares = (torch.where(swapped, each.flip(1), each) for each in (halves, shares))
    return Views(pixels.contiguous(memory_format=FORMAT), halves, shares, labels, points)


def _moved(boxes: Tensor, random: Random) -> Tensor:
    """Boxes (N, 4) placed and scaled a little differently."""
    middles, halves, _ = parts_about(boxes)
    middles = middles + halves * random.normal(len(boxes), 2, deviation=_MOVED)
    own = (boxes[:, 2:] - boxes[:, :2]) / 2 * random.normal(len(boxes), 2, deviation=_MOVED).exp()
    return torch.cat([middles - own, middles + own], dim=1)


def _cut(store: Store, which: Tensor, middles: Tensor, reach: Tensor, half: bool) -> Tensor:
    """Parts (B, SIDE, SIDE, 3) about middles; with a reach below zero mirrored."""
    steps = (torch.arange(SIDE, device=DEVICE) + 0.5) * (2 / SIDE) - 1
    x, y = (middles[:, n : n + 1] + reach[:, n : n + 1] * steps for n in (0, 1))
    return store.cut(which, x, y, torch.full_like(which, half, dtype=torch.bool))

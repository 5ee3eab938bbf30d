"""What the second look learns from: parts of pictures where the first network sees something."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
import torch
from dataset import Example, find_examples, read
from loss import iou
from network import Network, decode, enlarge, halve, make_grid
from processor import FORMAT
from second import CHANNELS, SIDE, cut_both, parts_about
from torch import Tensor

LEAST_SCORE = 0.1
"""Of boxes that are looked at."""
_MOST, _OVERLAP = 12, 0.6
"""Of one picture, the best so many are learned from, which do not overlap more than that."""
WIDE, WIDE_SIDE = 1.2, 76
"""Parts are kept larger than they are looked at, so that they can be moved and scaled a little."""
NONE, UNSURE = -1, -2
"""Labels of what is no landmark, and of what nobody could tell."""
_RIGHT, _WRONG = 0.3, 0.2
"""Overlaps with a landmark from which, and up to which, a box is one or none: what is right but
badly placed is placed anew."""
_LEAST_SHARE, _LEAST_PX = 0.4, 8.0
_SHIFT = 0.1  # of a true box's sides, of the parts about landmarks that are there in any case
_DOUBTFUL, _OF_DOUBTFUL = 0.2, 0.25  # of those with less score than that only so many are kept


class Looks(NamedTuple):
    """Parts (N, WIDE_SIDE, WIDE_SIDE, CHANNELS), labels (N,), boxes (N, 4) and what is true.

    ``truth`` (N, 6) is a box and a ground point, in pixels of the picture.
    """

    parts: npt.NDArray[np.uint8]
    labels: npt.NDArray[np.int8]
    boxes: npt.NDArray[np.float32]
    truth: npt.NDArray[np.float32]


def propose(network: Network, pictures: Tensor) -> list[tuple[Tensor, Tensor]]:
    """For each picture (B, 3, H, W) the boxes (n, 4) and scores (n,) to learn from."""
    boxes, scores = _cells(network, pictures)
    large, surely = _cells(network, halve(pictures))
    boxes, scores = torch.cat([boxes, enlarge(large)], 1), torch.cat([scores, surely], 1)
    return [_choose(some, sure) for some, sure in zip(boxes, scores, strict=True)]


def _cells(network: Network, pictures: Tensor) -> tuple[Tensor, Tensor]:
    """Boxes (B, cells, 4) and scores (B, cells)."""
    grid = make_grid(pictures.shape[2], pictures.shape[3])
    with torch.no_grad():
        raw = network(pictures)
    boxes = decode(raw[..., network.classes :], *grid)[0]
    return boxes, raw[..., : network.classes].amax(dim=2).sigmoid()


def _choose(boxes: Tensor, scores: Tensor) -> tuple[Tensor, Tensor]:
    good = scores > LEAST_SCORE
    boxes, scores = boxes[good], scores[good]
    sides = torch.cat([boxes[:, :2], boxes[:, 2:] - boxes[:, :2]], dim=1)
    kept = cv2.dnn.NMSBoxes(sides.tolist(), scores.tolist(), LEAST_SCORE, _OVERLAP)
    chosen = torch.from_numpy(np.asarray(kept, np.int64).reshape(-1))[:_MOST]
    return boxes[chosen], scores[chosen]


def collect(network: Network, folder: Path, seed: int) -> Looks:
    """Parts of all pictures of the worlds in a folder."""
    random = np.random.default_rng(seed)
    found = []
    examples = find_examples(folder)[0]
    for start in range(0, len(examples), 8):
        some = examples[start : start + 8]
        stack = torch.from_numpy(np.stack([read(one.path) for one in some]))
        pictures = stack.permute(0, 3, 1, 2).float() / 255
        for number, (boxes, scores) in enumerate(propose(network, pictures)):
            looks = _looks(some[number], pictures[number : number + 1], boxes, scores, random)
            found += [looks] if len(looks.labels) else []
        if start % 2400 == 0:
            print(f"second look: {start} of {len(examples)} pictures", flush=True)
    return Looks(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def _looks(
    example: Example, picture: Tensor, boxes: Tensor, scores: Tensor, random: np.random.Generator
) -> Looks:
    """Of one picture: what was proposed, and parts about its landmarks."""
    rows = torch.from_numpy(example.rows)
    sides = rows[:, 3:5] - rows[:, 1:3]
    seen = (rows[:, 7] >= _LEAST_SHARE) & (sides.amax(dim=1) >= _LEAST_PX)
    shift = torch.from_numpy(random.normal(0, _SHIFT, (len(rows), 4)).astype(np.float32))
    about = rows[:, 1:5] + shift * sides.repeat(1, 2)
    about = about[seen & (about[:, 2:] > about[:, :2] + 2).all(dim=1)]
    scores = torch.cat([scores, torch.ones(len(about))])
    boxes = torch.cat([boxes, about])
    labels, own = _labels(boxes, rows, seen)
    kept = scores > _DOUBTFUL
    kept |= torch.from_numpy(random.random(len(boxes)) < _OF_DOUBTFUL)
    kept = (labels >= 0) | ((labels == NONE) & kept)
    truth = rows[own][:, 1:7] if len(rows) else torch.zeros(len(boxes), 6)
    middles, halves, _ = parts_about(boxes[kept])
    pixels = (cut_both(picture, middles, halves * WIDE, WIDE_SIDE) * 255).round().byte()
    return Looks(
        pixels.permute(0, 2, 3, 1).numpy(),
        labels[kept].to(torch.int8).numpy(),
        boxes[kept].numpy(),
        truth[kept].float().numpy(),
    )


def _labels(boxes: Tensor, rows: Tensor, seen: Tensor) -> tuple[Tensor, Tensor]:
    """The class of each box, `NONE` or `UNSURE`, and the row of the landmark it is nearest to."""
    none = torch.zeros(len(boxes), dtype=torch.long)
    if not len(rows) or not len(boxes):
        return none + NONE, none
    overlap, own = iou(boxes[:, None], rows[None, :, 1:5]).max(dim=1)
    labels = torch.where(seen[own], rows[own, 0].long(), none + UNSURE)
    labels = torch.where(overlap < _RIGHT, none + UNSURE, labels)
    return torch.where(overlap < _WRONG, none + NONE, labels), own


def vary(
    looks: Looks, chosen: npt.NDArray[np.intp], turning: Sequence[int], random: np.random.Generator
) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
    """Parts as they are looked at, moved, scaled, mirrored, turned, and in other colours.

    Args:
        chosen: numbers of the parts, (B,).
        turning: classes of what lies flat, so that no side of it is up.

    Returns:
        Their pixels (B, CHANNELS, SIDE, SIDE), half sides and shares as `Parts` has them, labels
        (B,), and boxes with points (B, 6) from the parts' middles in half sides.
    """
    count, labels = len(chosen), looks.labels[chosen].astype(np.int64)
    flat = np.isin(labels, turning) | ((labels == NONE) & (random.random(count) < 0.6))
    signs = np.where(random.random((count, 2)) < 0.5, -1.0, 1.0)
    signs[:, 1] = np.where(flat, signs[:, 1], 1.0)
    swapped = flat & (random.random(count) < 0.5)
    scale = np.exp(random.normal(0, 0.05, (count, 2)))
    shift = random.normal(0, 0.05, (count, 2))
    # where a point of the new part, in its half sides, lies in the old one of margin 1
    A = np.zeros((count, 2, 2))
    A[:, 0, 0], A[:, 1, 1] = (signs * scale).T
    A[swapped] = A[swapped][:, :, ::-1]
    pixels = _sample(looks.parts[chosen], A / WIDE, shift / WIDE)
    about = parts_about(torch.from_numpy(looks.boxes[chosen]))
    middles, halves, shares = (one.numpy() for one in about)
    points = (looks.truth[chosen].reshape(count, 3, 2) - middles[:, None]) / halves[:, None]
    points = (points - shift[:, None]) @ np.linalg.inv(A).transpose(0, 2, 1)
    corners = np.sort(points[:, :2], axis=1).reshape(count, 4)
    wanted = np.hstack([corners, points[:, 2]]).astype(np.float32)
    sizes = np.stack([halves * scale, shares])
    sizes[:, swapped] = sizes[:, swapped][..., ::-1]
    return (
        _recoloured(pixels, random),
        *torch.from_numpy(sizes.astype(np.float32)),
        torch.from_numpy(labels),
        torch.from_numpy(wanted),
    )


def _sample(
    parts: npt.NDArray[np.uint8], A: npt.NDArray[np.float64], shift: npt.NDArray[np.float64]
) -> Tensor:
    theta = np.concatenate([A, shift[:, :, None]], axis=2).astype(np.float32)
    size = [len(parts), CHANNELS, SIDE, SIDE]
    grid = torch.nn.functional.affine_grid(torch.from_numpy(theta), size, align_corners=False)
    stack = torch.from_numpy(parts).permute(0, 3, 1, 2).float() / 255
    return torch.nn.functional.grid_sample(stack, grid, padding_mode="border", align_corners=False)


def _recoloured(parts: Tensor, random: np.random.Generator) -> Tensor:
    """Some with other hues, more or less contrast and light, a few inverted."""
    count = len(parts)
    turns = _hue_turns(np.where(random.random(count) < 0.5, random.uniform(0, 1, count), 0.0))
    pictures = parts.reshape(count, CHANNELS // 3, 3, SIDE * SIDE)
    parts = (turns[:, None] @ pictures).reshape(parts.shape)
    some = random.random((2, count)) < 0.6
    gain = np.where(some[0], random.uniform(0.65, 1.35, count), 1.0)
    gain = np.where(random.random(count) < 0.05, -gain, gain)
    lift = np.where(some[1], random.uniform(-0.12, 0.12, count), 0.0)
    gain, lift = (
        torch.from_numpy(one.astype(np.float32))[:, None, None, None] for one in (gain, lift)
    )
    varied = ((parts - 0.5) * gain + 0.5 + lift).clamp(0, 1)
    return varied.contiguous(memory_format=FORMAT)


def _hue_turns(shares: npt.NDArray[np.float64]) -> Tensor:
    """Matrices (N, 3, 3) that turn colours about the gray ones, by shares (N,) of a whole turn."""
    angles = 2 * np.pi * (shares[:, None] + np.arange(3) / 3)
    weights = (1 + 2 * np.cos(angles)) / 3  # of a channel itself, and of the two others
    turned = np.stack([np.roll(weights, by, axis=1) for by in range(3)], axis=1)
    return torch.from_numpy(turned.astype(np.float32))

"""Batches of the pictures on disk, varied a little each time."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
import torch
from loss import Truth
from processor import FORMAT

Canvas = npt.NDArray[np.uint8]
Rows = npt.NDArray[np.float32]
_QUARTERED = 0.6
"""Of the pictures, those that are made of four parts."""
_KEPT = 18_000  # pictures in memory, 5.5 GB: to decode them takes as long as to learn from them
_GRAY = 114  # what a letterbox is filled with
_LEAST_SHARE, _LEAST_PX = 0.3, 5.0
"""What shows less, or is smaller, is neither landmark nor background to the training."""


class Example(NamedTuple):
    """A picture's file, and the rows of its labels, (n, 8)."""

    path: Path
    rows: Rows


def find_examples(folder: Path) -> tuple[list[Example], tuple[str, ...]]:
    """All pictures of the worlds in a folder that are whole, and the names of the classes."""
    examples, classes = [], ()
    for path in sorted(folder.glob("*/labels.json")):
        labels = json.loads(path.read_text())
        classes = tuple(labels["classes"])
        for name, rows in labels["pictures"].items():
            examples.append(Example(path.parent / name, np.array(rows, np.float32).reshape(-1, 8)))
    return examples, classes


def some_pictures(folder: Path, seed: int) -> Iterator[npt.NDArray[np.float32]]:
    """Pictures (1, 3, H, W) of the worlds in a folder, RGB in 0 to 1, in a random order."""
    examples = find_examples(folder)[0]
    for number in np.random.default_rng(seed).permutation(len(examples)):
        picture = read(examples[number].path)
        yield np.ascontiguousarray(picture.transpose(2, 0, 1)[None] / np.float32(255))


def make_batch(
    examples: Iterator[Example], count: int, random: np.random.Generator, crop: int = 0
) -> tuple[torch.Tensor, list[Truth]]:
    """Pictures (B, 3, H, W) in 0 to 1, and their landmarks.

    Args:
        examples: as many as are needed are taken.
        count: of pictures.
        crop: side of the part that is cut out of each, mostly around a landmark; many pictures
            are four smaller parts then, so that one step shows more landmarks. 0: all of it.
    """
    pictures, truths = [], []
    for _ in range(count):
        if crop and random.random() < _QUARTERED:
            picture, rows = join([load(next(examples), random, crop // 2) for _ in range(4)])
        else:
            picture, rows = load(next(examples), random, crop)
        pictures.append(picture)
        truths.append(to_truth(rows))
    stack = torch.from_numpy(np.stack(pictures)).permute(0, 3, 1, 2)
    return stack.contiguous(memory_format=FORMAT).float() / 255, truths


def load(example: Example, random: np.random.Generator, crop: int) -> tuple[Canvas, Rows]:
    """One picture from the disk, varied, or a part of it."""
    picture, rows = _read(example.path), example.rows.copy()
    if random.random() < 0.15:
        picture, rows = _shrink(picture, rows, random)
    if crop:
        picture, rows = cut_out(picture, rows, crop, random)
    return vary(picture, rows, random)


def read(path: Path) -> Canvas:
    """A picture, RGB."""
    data = cv2.imread(str(path), cv2.IMREAD_COLOR)
    return np.asarray(cv2.cvtColor(data, cv2.COLOR_BGR2RGB), np.uint8)


_read = lru_cache(_KEPT)(read)


def join(parts: list[tuple[Canvas, Rows]]) -> tuple[Canvas, Rows]:
    """Four square parts as one picture, row by row."""
    (a, b, c, d), side = (picture for picture, _ in parts), len(parts[0][0])
    whole = np.vstack([np.hstack([a, b]), np.hstack([c, d])])
    rows = []
    for number, (_, some) in enumerate(parts):
        y, x = divmod(number, 2)
        rows.append(some + side * np.array([0, x, y, x, y, x, y, 0], np.float32))
    return whole, np.vstack(rows)


def to_truth(rows: Rows) -> Truth:
    """Rows of ``labels.json`` as tensors."""
    boxes = torch.from_numpy(rows[:, 1:5])
    side = (boxes[:, 2:] - boxes[:, :2]).amax(dim=1) if len(rows) else torch.zeros(0)
    ignored = (torch.from_numpy(rows[:, 7]) < _LEAST_SHARE) | (side < _LEAST_PX)
    kinds = torch.from_numpy(rows[:, 0]).long()
    return Truth(kinds, boxes, torch.from_numpy(rows[:, 5:7]), ignored)


def vary(picture: Canvas, rows: Rows, random: np.random.Generator) -> tuple[Canvas, Rows]:
    """Mirror, exchange colours, change the contrast."""
    if random.random() < 0.5:
        picture = picture[:, ::-1]
        last = picture.shape[1] - 1
        rows[:, [1, 3, 5]] = last - rows[:, [3, 1, 5]]
    if random.random() < 0.2:
        picture = picture[..., random.permutation(3)]
    if random.random() < 0.5:
        gain, lift = random.uniform(0.7, 1.3), random.uniform(-25, 25)
        table = np.clip(np.arange(256) * gain + lift, 0, 255).astype(np.uint8)
        picture = cv2.LUT(picture, table)
    return np.ascontiguousarray(picture), rows


def cut_out(
    picture: Canvas, rows: Rows, side: int, random: np.random.Generator
) -> tuple[Canvas, Rows]:
    """A square part, mostly one with a landmark in it; what is cut off shows less."""
    low, high = np.zeros(2), np.array(picture.shape[1::-1]) - side
    good = rows[(rows[:, 7] >= _LEAST_SHARE) & ((rows[:, 3:5] - rows[:, 1:3]).max(axis=1) < side)]
    if len(good) and random.random() < 0.9:
        box = good[random.integers(len(good)), 1:5]
        low, high = np.maximum(low, box[2:] + 1 - side), np.minimum(high, box[:2])
    x, y = (int(each) for each in np.floor(random.uniform(low, np.maximum(high, low) + 1)))
    x, y = (min(at, most - side) for at, most in zip((x, y), picture.shape[1::-1], strict=True))
    rows = rows - np.array([0, x, y, x, y, x, y, 0], np.float32)
    before = np.prod(rows[:, 3:5] - rows[:, 1:3], axis=1)
    rows[:, 1:5] = np.clip(rows[:, 1:5], -0.5, side - 0.5)
    after = np.prod(rows[:, 3:5] - rows[:, 1:3], axis=1)
    rows[:, 7] *= after / np.maximum(before, 1e-6)
    return np.ascontiguousarray(picture[y : y + side, x : x + side]), rows[after > 0]


def _shrink(picture: Canvas, rows: Rows, random: np.random.Generator) -> tuple[Canvas, Rows]:
    """Another scale within a gray frame, as a letterbox makes it."""
    height, width = picture.shape[:2]
    scale = random.uniform(0.5, 1.0)
    h, w = round(height * scale), round(width * scale)
    y, x = int(random.integers(0, height - h + 1)), int(random.integers(0, width - w + 1))
    frame = np.full_like(picture, _GRAY)
    frame[y : y + h, x : x + w] = cv2.resize(picture, (w, h), interpolation=cv2.INTER_AREA)
    for columns, start, ratio in (([1, 3, 5], x, w / width), ([2, 4, 6], y, h / height)):
        rows[:, columns] = (rows[:, columns] + 0.5) * ratio - 0.5 + start
    return frame, rows

"""Batches of parts of the pictures, varied a little each time."""

from __future__ import annotations

import torch
from colours import Recolouring, recolour
from device import DEVICE, FORMAT, Random
from loss import Truth
from store import ABSENT, Store
from torch import Tensor
from torch.nn.functional import pad

_QUARTERED = 0.6
"""Fraction of pictures composed of four parts."""
_AROUND = 0.9
"""Fraction of parts centred on a landmark, if there is one."""
_SHRUNK, _LEAST_SCALE = 0.15, 0.5
"""Fraction of parts at another scale, in a gray letterbox."""
_HALF_BELOW = 0.75  # at smaller scales the picture of half the size is looked at
_GRAY = 114 / 255
_LEAST_SHARE, _LEAST_PX = 0.3, 5.0
"""Below these, a landmark is neither positive nor background in training."""
_COLOURS = Recolouring(turned=0.2, contrast=0.5, gain=(0.7, 1.3), brightness=0.5, lift=0.1)


def make_batch(store: Store, count: int, random: Random, crop: int = 0) -> tuple[Tensor, Truth]:
    """Pictures (B, 3, H, W) in 0 to 1, and their landmarks.

    Args:
        count: of pictures, at least 2.
        crop: side of the part that is cut out of each, mostly around a landmark; many pictures
            are four smaller parts then, so that one step shows more landmarks. 0: all of it.
    """
    if crop:
        joined = int(_QUARTERED * count)
        pictures, rows = _join(*_cut(store, 4 * joined, crop // 2, random))
        more, few = _cut(store, count - joined, crop, random)
        few = pad(few, (0, 0, 0, rows.shape[1] - few.shape[1]), value=ABSENT)
        pictures, rows = torch.cat([pictures, more]), torch.cat([rows, few])
    else:
        pictures, rows = _cut(store, count, store.side, random)
    pictures = recolour(pictures.permute(0, 3, 1, 2).contiguous(), _COLOURS, random)
    return pictures.contiguous(memory_format=FORMAT), to_truth(rows)


def _cut(store: Store, count: int, side: int, random: Random) -> tuple[Tensor, Tensor]:
    """Square parts (P, side, side, 3), some mirrored, and their rows (P, n, 8)."""
    which = random.choice(store.weights, count)
    shrunk = random.chance(_SHRUNK, count)
    scale = torch.where(shrunk, random.uniform(count, low=_LEAST_SCALE), 1.0)[:, None]
    mirrored = random.chance(0.5, count)[:, None]
    rows = store.rows[which]
    first = _choose_place(rows, scale, side, store.side, random)
    steps = (torch.arange(side, device=DEVICE) + 0.5) / scale - 0.5
    x, y = first[:, :1] + steps, first[:, 1:] + steps
    x = torch.where(mirrored, x.flip(1), x)
    parts = store.cut(which, x, y, scale[:, 0] < _HALF_BELOW)
    within_x, within_y = ((at > -0.5) & (at < store.side - 0.5) for at in (x, y))
    within = within_y[:, :, None, None] & within_x[:, None, :, None]
    return torch.where(within, parts, _GRAY), cut_rows(rows, first, scale, side, mirrored)


def _choose_place(rows: Tensor, scale: Tensor, side: int, whole: int, random: Random) -> Tensor:
    """The first pixel (P, 2) of each part: mostly such that a landmark is in it, if it fits."""
    count, span = len(rows), side / scale
    frame = whole / scale  # how wide the picture is with its gray frame, which begins at `low`
    low = (whole - frame) * random.uniform(count, 2)
    high = low + frame - span
    fits = (rows[..., 3:5] - rows[..., 1:3]).amax(dim=2) < span
    fits &= (rows[..., 0] != ABSENT) & (rows[..., 7] >= _LEAST_SHARE)
    value, own = torch.where(fits, random.uniform(*fits.shape), -1.0).max(dim=1)
    around = ((value >= 0) & random.chance(_AROUND, count))[:, None]
    box = rows[torch.arange(count, device=DEVICE), own, 1:5]
    low = torch.where(around, torch.maximum(low, box[:, 2:] + 1 - span), low)
    high = torch.where(around, torch.minimum(high, box[:, :2]), high)
    at = low + (high - low).clamp(min=0) * random.uniform(count, 2)
    return torch.where(scale < 1, at, at.round())


def cut_rows(rows: Tensor, first: Tensor, scale: Tensor, side: int, mirrored: Tensor) -> Tensor:
    """The rows (P, n, 8) of parts: what is cut off shows less, and what is outside is absent.

    Args:
        first: (P, 2) pixel of the picture where each part begins.
        scale, mirrored: (P, 1).
    """
    start = first.repeat(1, 3)[:, None]
    at = (rows[..., 1:7] - start + 0.5) * scale[..., None] - 0.5
    x, y = at[..., 0::2], at[..., 1::2]
    x = torch.where(mirrored[..., None], side - 1 - x[..., [1, 0, 2]], x)
    at = torch.stack([x, y], dim=-1).flatten(2)
    boxes = at[..., :4].clamp(-0.5, side - 0.5)
    before, after = ((b[..., 2:] - b[..., :2]).prod(dim=2) for b in (at[..., :4], boxes))
    kinds = torch.where(after > 0, rows[..., 0], float(ABSENT))
    share = rows[..., 7] * after / before.clamp(min=1e-6)
    return torch.cat([kinds[..., None], boxes, at[..., 4:], share[..., None]], dim=2)


def _join(parts: Tensor, rows: Tensor) -> tuple[Tensor, Tensor]:
    """Four square parts each as one picture, row by row."""
    side, channels = parts.shape[2:]
    tiles = parts.reshape(-1, 2, 2, side, side, channels).transpose(2, 3)
    y, x = (side * (torch.arange(4, device=DEVICE) // by % 2).float() for by in (2, 1))
    zero = torch.zeros_like(x)
    offset = torch.stack([zero, x, y, x, y, x, y, zero], dim=1)[:, None]
    moved = rows.reshape(-1, 4, *rows.shape[1:]) + offset
    return tiles.reshape(-1, 2 * side, 2 * side, channels), moved.flatten(1, 2)


def to_truth(rows: Tensor) -> Truth:
    """Rows (B, n, 8) as the loss takes them, without most that are absent."""
    there = rows[..., 0] != ABSENT
    most = max(int(there.sum(dim=1).max()), 1)
    order = there.int().argsort(dim=1, descending=True)[:, :most, None]
    rows = rows.gather(1, order.expand(-1, -1, rows.shape[2]))
    boxes = rows[..., 1:5]
    small = (boxes[..., 2:] - boxes[..., :2]).amax(dim=2) < _LEAST_PX
    ignored = (rows[..., 0] != ABSENT) & (small | (rows[..., 7] < _LEAST_SHARE))
    return Truth(rows[..., 0].long(), boxes, rows[..., 5:7], ignored)

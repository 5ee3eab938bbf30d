"""Other colours for pictures, so that a network does not learn them by heart."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from device import DEVICE, Random
from torch import Tensor


class Recolouring(NamedTuple):
    """In how large a share of the pictures what is changed, and how much."""

    turned: float
    """Other hues, turned about the gray ones by any angle."""
    contrast: float
    """More or less contrast."""
    gain: tuple[float, float]
    """The least and the most, by which differences from the middle gray are multiplied."""
    brightness: float
    """Lighter or darker."""
    lift: float
    """By how much at most; 1 is from black to white."""
    exchanged: float = 0.1
    """Red for blue."""
    inverted: float = 0.0


def recolour(pictures: Tensor, how: Recolouring, random: Random) -> Tensor:
    """Pictures (N, 3 k, H, W) in 0 to 1, varied; k that belong together in the same way."""
    count = len(pictures)
    angle = 2 * math.pi * random.uniform(count) * random.chance(how.turned, count)
    matrices = _hue_turns(angle)
    exchanged = random.chance(how.exchanged, count)[:, None, None]
    matrices = torch.where(exchanged, matrices.flip(2), matrices)
    gain = random.uniform(count, low=how.gain[0], high=how.gain[1])
    gain = torch.where(random.chance(how.contrast, count), gain, 1.0)
    gain = torch.where(random.chance(how.inverted, count), -gain, gain)
    lift = random.uniform(count, low=-how.lift, high=how.lift)
    lift = lift * random.chance(how.brightness, count)
    matrices = matrices * gain[:, None, None]
    offset = 0.5 + lift - 0.5 * gain  # gray stays where it is, but for the lift
    channels = pictures.reshape(count, pictures.shape[1] // 3, 3, -1)
    varied = matrices[:, None] @ channels + offset[:, None, None, None]
    return varied.clamp(0, 1).reshape(pictures.shape)


def _hue_turns(angles: Tensor) -> Tensor:
    """Matrices (N, 3, 3) that turn colours about the gray ones by angles (N,), radians."""
    thirds = torch.arange(3, device=DEVICE) * (2 * math.pi / 3)
    weights = (1 + 2 * torch.cos(angles[:, None] + thirds)) / 3  # of a channel, and of the others
    return torch.stack([weights.roll(by, dims=1) for by in range(3)], dim=1)

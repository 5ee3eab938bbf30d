"""The refinement head: a second network for a crop of each proposal.

Cells that see a whole picture at once learn slowly to distinguish a pad from a sign with a letter.
A crop of the size of the object, whatever that is, shows it at once. A wider crop shows the
surroundings: a body above legs, a line that continues. Boxes, points and their variances are
estimated anew, in half sides of the crop.

Source of the idea: Girshick et al., Rich Feature Hierarchies, 2014; Cai and Vasconcelos, Cascade
R-CNN, 2018.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from network import BOX, POINT, SPREAD, Residual, conv, halve
from torch import Tensor, nn

SIDE = 64
"""Pixels along the part that is looked at."""
MARGIN = 1.4
"""By how much the part is larger than the box."""
CHANNELS = 6
"""Input channels: the crop, RGB, then the wider one."""
WIDER = 2.0
"""By how much the sides of the wider part are longer."""
_NARROWEST = 0.5
"""A part's shorter side by its longer one: beside a thin post there is something to see, too."""
_LEAST_PX = 4.0  # of a box
_LEAST_SPREAD, _MOST_SPREAD = -6.0, 3.0


class Parts(NamedTuple):
    """Parts of a picture about N boxes."""

    middles: Tensor
    """(N, 2) of the boxes and the parts, pixels."""
    halves: Tensor
    """(N, 2) half sides of the parts, pixels."""
    shares: Tensor
    """(N, 2) sides of the boxes by those of the parts."""


class Second(nn.Module):
    """Parts of pictures to classes, boxes and points.

    Args:
        classes: how many; one more means none of them.
        width: channels of the first layer; all others follow.
    """

    def __init__(self, classes: int, width: int = 16) -> None:
        super().__init__()
        self.classes, self.width = classes, width
        c, hidden = width, 96
        self.near = nn.Sequential(
            conv(CHANNELS, c, 2), conv(c, 2 * c, 2), Residual(2 * c), conv(2 * c, 4 * c, 2)
        )
        self.sizes = nn.Linear(4, 4 * c)
        self.whole = nn.Sequential(
            Residual(4 * c),
            Residual(4 * c),
            conv(4 * c, 5 * c, 2),
            nn.Flatten(),
            nn.Dropout(0.1),
            nn.Linear(5 * c * (SIDE // 16) ** 2, hidden),
            nn.ReLU(),
        )
        self.head = nn.Linear(hidden, classes + 1 + BOX + POINT + SPREAD)
        nn.init.normal_(self.head.weight, std=0.01)
        nn.init.zeros_(self.head.bias)

    def forward(self, pixels: Tensor, halves: Tensor, shares: Tensor) -> Tensor:
        """Raw numbers of each part.

        Args:
            pixels: (N, CHANNELS, SIDE, SIDE) in 0 to 1, as `cut_both` gives them.
            halves, shares: as in `Parts`.

        Returns:
            (N, classes + 9): logits of the classes and of none, then what `decode_parts` takes.
        """
        sizes = torch.cat([(halves.log2() - 4) / 2, shares.log2()], dim=1)
        seen = self.near(pixels - 0.5) + self.sizes(sizes)[:, :, None, None]
        return self.head(self.whole(seen))


def decode_parts(raw: Tensor, shares: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Boxes (N, 4), points (N, 2) and log deviations (N, 2), from the middles, in half sides.

    Args:
        raw: (N, 8), without the classes.
        shares: as in `Parts`.
    """
    usual = torch.cat([-shares, shares], dim=1)
    points, spread = raw[:, BOX : BOX + POINT], raw[:, BOX + POINT :]
    return raw[:, :BOX] + usual, points, spread.clamp(_LEAST_SPREAD, _MOST_SPREAD)


def parts_about(boxes: Tensor) -> Parts:
    """The parts about boxes (N, 4) x0 y0 x1 y1, pixels."""
    low, high = boxes[:, :2], boxes[:, 2:]
    own = ((high - low) / 2).clamp(min=_LEAST_PX / 2)
    halves = torch.maximum(MARGIN * own, MARGIN * _NARROWEST * own.flip(1))
    return Parts((low + high) / 2, halves, own / halves)


def cut_both(picture: Tensor, middles: Tensor, halves: Tensor) -> Tensor:
    """Parts and the wider ones (N, CHANNELS, SIDE, SIDE), as `cut` has them."""
    wider = cut(halve(picture), (middles - 0.5) / 2, WIDER / 2 * halves)
    return torch.cat([cut(picture, middles, halves), wider], dim=1)


def cut(picture: Tensor, middles: Tensor, halves: Tensor) -> Tensor:
    """Parts (N, 3, SIDE, SIDE) of a picture (1, 3, H, W), each stretched to a square.

    Beyond the picture's edge its last pixels go on. Pixel centres are at whole numbers.
    """
    steps = (torch.arange(SIDE) + 0.5) * (2 / SIDE) - 1
    across = middles[:, :1] + halves[:, :1] * steps  # (N, side)
    down = middles[:, 1:] + halves[:, 1:] * steps
    width, height = picture.shape[3], picture.shape[2]
    x = ((across + 0.5) * 2 / width - 1)[:, None, :] + 0 * down[:, :, None]
    y = ((down + 0.5) * 2 / height - 1)[:, :, None] + 0 * across[:, None, :]
    grid = torch.stack([x, y], dim=-1).reshape(1, -1, SIDE, 2)
    sampled = nn.functional.grid_sample(picture, grid, padding_mode="border", align_corners=False)
    return sampled[0].reshape(3, -1, SIDE, SIDE).transpose(0, 1)

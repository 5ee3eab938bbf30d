"""The network: plain 3x3 convolutions, a feature pyramid, and heads without anchors.

Source: Tian et al., FCOS, 2019; points and their variances beside the boxes are ours, by the
likelihood of Kendall and Gal, What Uncertainties Do We Need, 2017.
"""

from __future__ import annotations

import math
from functools import lru_cache

import torch
from torch import Tensor, nn

STRIDES = 8, 16, 32
_STEADY = 0.998
BOX, POINT, SPREAD = 4, 2, 2
"""Numbers a cell gives beside the classes: distances to the box's edges, the ground point from the
cell's centre, and the logarithm of the point's standard deviations; all in strides."""


def conv(inputs: int, outputs: int, stride: int = 1, size: int = 3) -> nn.Sequential:
    """Convolution, normalisation, ReLU."""
    layer = nn.Conv2d(inputs, outputs, size, stride, size // 2, bias=False)
    return nn.Sequential(layer, nn.BatchNorm2d(outputs), nn.ReLU(inplace=True))


class Residual(nn.Module):
    """Two convolutions beside a shortcut."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.body = nn.Sequential(conv(width, width), conv(width, width))

    def forward(self, x: Tensor) -> Tensor:
        return x + self.body(x)


class Network(nn.Module):
    """Pictures to raw cells.

    Args:
        classes: how many.
        width: channels of the first layer; all others follow.
    """

    def __init__(self, classes: int, width: int = 16) -> None:
        super().__init__()
        self.classes, self.width = classes, width
        c, neck = width, 3 * width
        self.stem = nn.Sequential(conv(3, c, 2), conv(c, 2 * c, 2))
        self.stages = nn.ModuleList(
            [
                nn.Sequential(conv(2 * c, 3 * c, 2), Residual(3 * c)),
                nn.Sequential(conv(3 * c, 6 * c, 2), Residual(6 * c), Residual(6 * c)),
                nn.Sequential(conv(6 * c, 10 * c, 2), Residual(10 * c)),
            ]
        )
        self.laterals = nn.ModuleList([conv(each * c, neck, size=1) for each in (3, 6, 10)])
        self.towers = nn.ModuleList(
            [nn.Sequential(conv(neck, neck), conv(neck, neck)) for _ in STRIDES]
        )
        rest = BOX + POINT + SPREAD
        self.heads = nn.ModuleList([nn.Conv2d(neck, classes + rest, 1) for _ in STRIDES])
        for head in self.heads:
            nn.init.normal_(head.weight, std=0.01)
            nn.init.zeros_(head.bias)
            nn.init.constant_(head.bias[:classes], -math.log(99))  # one cell of a hundred is taken
            nn.init.constant_(head.bias[classes : classes + BOX], 0.7)

    def forward(self, pictures: Tensor) -> Tensor:
        """Raw numbers of all cells.

        Args:
            pictures: (B, 3, H, W) RGB in 0 to 1; H and W are multiples of 32.

        Returns:
            (B, cells, classes + 8): logits of the classes, then as `BOX`, `POINT`, `SPREAD` say.
        """
        x, levels = self.stem(pictures - 0.5), []
        for stage in self.stages:
            x = stage(x)
            levels.append(x)
        levels = [lateral(x) for lateral, x in zip(self.laterals, levels, strict=True)]
        for low in (1, 0):
            wider = nn.functional.interpolate(levels[low + 1], scale_factor=2.0, mode="nearest")
            levels[low] = levels[low] + wider
        heads = zip(self.heads, self.towers, levels, strict=True)
        return torch.cat([head(tower(x)).flatten(2) for head, tower, x in heads], 2).transpose(1, 2)


def make_optimizer(network: nn.Module, decay: float) -> torch.optim.Optimizer:
    """AdamW, whose decay spares gains and biases: a branch whose gain fades never comes back."""
    weights = [each for each in network.parameters() if each.ndim > 1]
    rest = [each for each in network.parameters() if each.ndim == 1]
    return torch.optim.AdamW(
        [{"params": weights}, {"params": rest, "weight_decay": 0.0}], weight_decay=decay
    )


def follow(average: nn.Module, network: nn.Module, steps: int) -> None:
    """Let the slow average of a network follow it: it serves better than the network itself."""
    keep = min(_STEADY, 1 - 1 / (1 + steps / 10))
    with torch.no_grad():
        theirs = network.state_dict()
        for name, value in average.state_dict().items():
            if value.dtype.is_floating_point:
                value.mul_(keep).add_(theirs[name], alpha=1 - keep)


def grid_of(pictures: Tensor) -> tuple[Tensor, Tensor]:
    """Cells of pictures (B, 3, H, W): see `make_grid`."""
    return make_grid(pictures.shape[2], pictures.shape[3], pictures.device)


@lru_cache
def make_grid(height: int, width: int, device: torch.device) -> tuple[Tensor, Tensor]:
    """Centres (cells, 2) in pixels and strides (cells, 1); pixel centres are whole numbers."""
    centres, strides = [], []
    for stride in STRIDES:
        y, x = torch.meshgrid(
            torch.arange(height // stride), torch.arange(width // stride), indexing="ij"
        )
        at = torch.stack([x, y], dim=-1).reshape(-1, 2).float()
        centres.append((at + 0.5) * stride - 0.5)
        strides.append(torch.full((len(at), 1), float(stride)))
    return torch.cat(centres).to(device), torch.cat(strides).to(device)


def decode(raw: Tensor, centres: Tensor, strides: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Boxes x0 y0 x1 y1, ground points u v, and the points' log standard deviations, in pixels.

    Args:
        raw: (..., cells, 8), without the classes.
    """
    reach = raw[..., :BOX].clamp(-6, 6).exp() * strides
    boxes = torch.cat([centres - reach[..., :2], centres + reach[..., 2:]], dim=-1)
    points = centres + raw[..., BOX : BOX + POINT] * strides
    spread = raw[..., BOX + POINT :].clamp(-7, 4) + strides.log()
    return boxes, points, spread


def halve(pictures: Tensor) -> Tensor:
    """Pictures (B, 3, H, W) at half their size."""
    return nn.functional.avg_pool2d(pictures, 2)


def enlarge(boxes: Tensor) -> Tensor:
    """Boxes found in a picture of half the size, in pixels of the whole one."""
    return boxes * 2 + 0.5

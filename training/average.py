"""Average both networks of two files that `export.py` wrote.

    python training/average.py START.onnx TRAINED.onnx PICTURES RESULT.onnx --share 0.5

Training on few worlds forgets some of what was learned from many; the mean of the weights before
and after keeps both, as long as they have not diverged.

Source of the idea: Wortsman et al., Robust fine-tuning of zero-shot models, 2022.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import advice  # noqa: F401
import torch
from export import write_onnx
from layers import mean
from network import Network
from running import run
from second import CHANNELS, SIDE, Second
from start import Start, read_start, start_first, start_second
from store import some_pictures
from torch import nn

from ros_visualise.core.errors import OpenError


def average(
    start: Path,
    trained: Path,
    pictures: Path,
    result: Path,
    shares: tuple[float, float],
    seed: int,
) -> None:
    """Write the mean.

    Args:
        pictures: worlds, to measure the ranges of the integers by.
        shares: of the trained weights, 0 to 1, of the first network and of the refinement head.
        seed: chooses these pictures.

    Raises:
        OpenError: the networks have different layers.
    """
    old, new = read_start(start), read_start(trained)
    if (old.widths, len(old.classes)) != (new.widths, len(new.classes)):
        raise OpenError(f"{start} and {trained}: networks of different shapes")
    classes = len(new.classes)
    network, head = Network(classes, new.widths[0]), Second(classes, new.widths[1])
    first = mean(old.first, new.first, shares[0], _layers(network))
    second = mean(old.second, new.second, shares[1], _layers(head))
    both = Start(first, second, new.classes, new.steps)
    start_first(network, both, both.classes, torch.rand(2, 3, 64, 64))
    parts = torch.rand(2, CHANNELS, SIDE, SIDE), torch.ones(2, 2), torch.ones(2, 2)
    start_second(head, both, both.classes, parts)
    about = {"seed": str(seed), "steps": str(both.steps), "shares": "{} {}".format(*shares)}
    write_onnx(network, head, both.classes, result, about, some_pictures(pictures, seed))


def _layers(network: nn.Module) -> int:
    return sum(isinstance(each, nn.Conv2d | nn.Linear) for each in network.modules())


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("start", type=Path)
    parser.add_argument("trained", type=Path)
    parser.add_argument("pictures", type=Path, help="folder of worlds")
    parser.add_argument("result", type=Path)
    share = "of TRAINED in the %s (default: %%(default)s)"
    parser.add_argument("--first-share", type=float, default=0.5, help=share % "first network")
    parser.add_argument("--share", type=float, default=0.5, help=share % "refinement head")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    shares = asked.first_share, asked.share
    average(asked.start, asked.trained, asked.pictures, asked.result, shares, asked.seed)
    return 0


if __name__ == "__main__":
    run(main)

"""The layers of a network, and the mean of two networks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple


class Layer(NamedTuple):
    """A convolution or dense layer in a file: tensors, or arrays."""

    weight: Any
    bias: Any


def mean(old: Sequence[Layer], new: Sequence[Layer], share: float, count: int) -> list[Layer]:
    """The mean of the first ``count`` layers of two networks, so much of it from the new ones.

    Raises:
        ValueError: their numbers differ.
    """
    pairs = zip(old[:count], new[:count], strict=True)
    return [
        Layer(*((1 - share) * a + share * b for a, b in zip(*layers, strict=True)))
        for layers in pairs
    ]

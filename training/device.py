"""Choice of the hardware, GPU or CPU, and its fastest use."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import torch
from torch import Tensor

_INFO = Path("/proc/cpuinfo")

DEVICE = torch.device("cuda" if torch.cuda.is_available() else "cpu")
torch.backends.cudnn.benchmark = True  # tries which way is fastest: batches are equally large


def _has_bfloat16() -> bool:
    """True if the CPU has instructions for bfloat16; without them it is 15 times as slow."""
    if DEVICE.type == "cuda":
        return torch.cuda.get_device_capability() >= (8, 0)
    words = set(_INFO.read_text().split()) if _INFO.exists() else set()
    return bool(words & {"avx512_bf16", "amx_bf16"})


_BFLOAT16 = _has_bfloat16()
FORMAT = torch.channels_last if _BFLOAT16 else torch.contiguous_format
"""The order of the numbers of pictures and weights that is fast."""


def precision() -> AbstractContextManager[object]:
    """For what is run in it: bfloat16 where that is fast, otherwise float32."""
    return torch.autocast(DEVICE.type, dtype=torch.bfloat16) if _BFLOAT16 else nullcontext()


class Random:
    """Random numbers on the device."""

    def __init__(self, *seed: int) -> None:
        self._generator = torch.Generator(DEVICE)
        self._generator.manual_seed(hash(seed) % 2**63)

    def uniform(self, *shape: int, low: float = 0.0, high: float = 1.0) -> Tensor:
        """From ``low`` to ``high``."""
        return low + (high - low) * torch.rand(shape, generator=self._generator, device=DEVICE)

    def normal(self, *shape: int, deviation: float) -> Tensor:
        """Around zero."""
        return deviation * torch.randn(shape, generator=self._generator, device=DEVICE)

    def chance(self, share: float, *shape: int) -> Tensor:
        """True in so large a share of the cases."""
        return self.uniform(*shape) < share

    def index(self, count: int, *shape: int) -> Tensor:
        """Whole numbers from zero below ``count``."""
        return torch.randint(count, shape, generator=self._generator, device=DEVICE)

    def choice(self, weights: Tensor, count: int) -> Tensor:
        """Numbers (count,) of some of the weights, each as often as its weight says."""
        return torch.multinomial(weights, count, replacement=True, generator=self._generator)

"""How the processor trains fastest."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import torch

_INFO = Path("/proc/cpuinfo")


def _has_bfloat16() -> bool:
    """Whether it has instructions for bfloat16; without them that takes fifteen times as long."""
    words = set(_INFO.read_text().split()) if _INFO.exists() else set()
    return bool(words & {"avx512_bf16", "amx_bf16"})


_BFLOAT16 = _has_bfloat16()
FORMAT = torch.channels_last if _BFLOAT16 else torch.contiguous_format
"""The order of the numbers of pictures and weights that is fast."""


def precision() -> AbstractContextManager[object]:
    """For what is run in it: bfloat16 where that is fast, otherwise float32."""
    return torch.autocast("cpu", dtype=torch.bfloat16) if _BFLOAT16 else nullcontext()

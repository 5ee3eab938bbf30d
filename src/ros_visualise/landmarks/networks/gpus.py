"""The NVIDIA GPUs that this process may use."""

from __future__ import annotations

import os
import re
from itertools import takewhile
from pathlib import Path

_DEVICES = Path("/dev")
_ONLY_ONE = ("dxg", "nvgpu", "nvhost-gpu")  # of Windows' Linux, and of Jetsons


def gpus() -> int:
    """Number of GPUs, by their device files and ``CUDA_VISIBLE_DEVICES``."""
    chosen = os.environ.get("CUDA_VISIBLE_DEVICES")
    if chosen is not None:
        valid = takewhile(lambda one: one.strip() not in ("", "-1"), chosen.split(","))
        return len([*valid])  # as CUDA does: what comes after an invalid one does not count
    count = sum(bool(re.fullmatch(r"nvidia\d+", one.name)) for one in _DEVICES.glob("nvidia*"))
    return count or int(any((_DEVICES / name).exists() for name in _ONLY_ONE))

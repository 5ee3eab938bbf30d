"""Round steps for sliders and trackbars."""

from __future__ import annotations

import math

_ROUNDING = 1e-9


def round_step(largest: float) -> float:
    """The largest of ... 0.1, 0.2, 0.5, 1, 2, 5 ... that is not above ``largest``."""
    power = 10.0 ** math.floor(math.log10(largest))
    return next(m * power for m in (5, 2, 1) if m * power <= largest * (1 + _ROUNDING))

"""Round steps for sliders and trackbars."""

from __future__ import annotations

import math

from ros_visualise.core.params import Spec

_ROUNDING = 1e-9


def step_of(spec: Spec, low: float, high: float, count: int) -> float:
    """The step of a number's slider: as declared, else 1, or a round one for about so many."""
    if spec.step:
        return spec.step
    return 1 if spec.type is int else round_step((high - low) / count)


def round_step(largest: float) -> float:
    """The largest of ... 0.1, 0.2, 0.5, 1, 2, 5 ... that is not above ``largest``."""
    power = 10.0 ** math.floor(math.log10(largest))
    return next(m * power for m in (5, 2, 1) if m * power <= largest * (1 + _ROUNDING))

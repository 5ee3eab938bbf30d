"""Samples with impossible times, as from a single wrong bit in a log."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

_FAR_US = 10_000_000
_FAR_PERIODS = 100  # of a log that has little in it
_NEVER_US = 2**52  # 142 years after the start

_Times = npt.NDArray[np.int64]
_Mask = npt.NDArray[np.bool_]


def find_strays(times_us: Mapping[str, npt.NDArray[np.uint64]]) -> dict[str, _Mask]:
    """Which samples jump far from those before and after them.

    Either they lie out of order within their own topic, or no other sample of any topic is near.

    Args:
        times_us: topic -> (N,) times in the order of the file.

    Returns:
        topic -> (N,) whether it is a stray.
    """
    signed = {name: np.minimum(t, _NEVER_US).astype(np.int64) for name, t in times_us.items()}
    every = np.sort(np.concatenate([np.zeros(0, np.int64), *signed.values()]))
    every = every[every < _NEVER_US]
    if len(every) < 3:  # too few to tell which is right
        return {name: times == _NEVER_US for name, times in signed.items()}
    far_us = max(_FAR_US, _FAR_PERIODS * int(np.median(np.diff(every))))
    lonely = every[_is_far(every, far_us)]
    return {
        name: _is_misplaced(times, far_us) | np.isin(times, lonely) | (times == _NEVER_US)
        for name, times in signed.items()
    }


def _is_far(ordered_us: _Times, far_us: int) -> _Mask:
    """Whether each time is far from the one before it and the one after it."""
    steps = np.concatenate([[far_us + 1], np.diff(ordered_us), [far_us + 1]])
    is_far: _Mask = (steps[:-1] > far_us) & (steps[1:] > far_us)
    return is_far


def _is_misplaced(times_us: _Times, far_us: int) -> _Mask:
    """Whether each time stands far off between two that are in order."""
    found = np.zeros(len(times_us), bool)
    before, own, after = times_us[:-2], times_us[1:-1], times_us[2:]
    is_beyond = (own > after + far_us) | (own < before - far_us)
    found[1:-1] = is_beyond & (before <= after)
    return found

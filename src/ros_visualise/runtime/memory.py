"""The memory of what is let go of: images' is used again, and what nobody uses is given back."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from functools import cache, partial

import numpy as np

from ros_visualise.core import supervision

_LARGEST_BYTES = 16 * 2**20
_GIVEN_BACK_S = 60.0

Trim = Callable[[int], int]


@cache
def tend_memory() -> None:
    """Have the C library keep what is let go of for a while, and no longer; done once."""
    keep_freed_images()
    trim = find_trim()
    if trim is not None:
        supervision.start("memory", partial(_give_back, trim))


def keep_freed_images() -> None:
    """Have the C library keep the memory of images that are let go of, for the next ones.

    glibc keeps twice as much as the largest block that was ever freed (mallopt(3),
    M_MMAP_THRESHOLD), so a block is allocated and freed at once; it is never touched, and costs
    nothing. Without it a node whose images have 8 MB gave their memory back each time, and got it
    anew as 3,700 empty pages: a tenth of the processor time of separate nodes at 4K. Larger images
    are better off with memory of their own, which NumPy asks for in large pages.
    """
    np.empty(_LARGEST_BYTES, np.uint8)


def find_trim() -> Trim | None:
    """glibc's malloc_trim(3), which gives back whole pages that nobody uses; None without glibc.

    glibc gives threads heaps of their own. By itself it gives back only the ends of these, so that
    in a process of many threads each heap becomes as large as it ever was, and all of them together
    go on growing for hours.
    """
    try:
        found: Trim = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):
        return None
    return found


def _give_back(trim: Trim) -> None:
    while True:
        time.sleep(_GIVEN_BACK_S)
        trim(0)

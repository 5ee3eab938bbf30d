"""The memory of images, which is used again rather than given back to the kernel."""

from __future__ import annotations

import numpy as np

_LARGEST_BYTES = 16 * 2**20


def keep_freed_images() -> None:
    """Have the C library keep the memory of images that are let go of, for the next ones.

    glibc keeps twice as much as the largest block that was ever freed (mallopt(3),
    M_MMAP_THRESHOLD), so a block is allocated and freed at once; it is never touched, and costs
    nothing. Without it a node whose images have 8 MB gave their memory back each time, and got it
    anew as 3,700 empty pages: a tenth of the processor time of separate nodes at 4K. Larger images
    are better off with memory of their own, which NumPy asks for in large pages.
    """
    np.empty(_LARGEST_BYTES, np.uint8)

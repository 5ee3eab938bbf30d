"""Limits of what one input may take: sizes that it declares are checked before it is read.

All limits are shares of one number, `--max-memory`, so that a small input does not bring the whole
process above that.
"""

from __future__ import annotations

import math
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ros_visualise.core.errors import OpenError, TooLarge, UsageError

DEFAULT_MEMORY = 2 << 30
MAX_TAG_M = 100.0
"""Side of a tag that has poses."""

_LEAST_MEMORY = 64 << 20
_UNITS = {"": 1, "K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}

_GIB, _MIB = 1 << 30, 1 << 20
_SHARE = 16  # several images are held at once
_COLOR_BYTES = 3  # of a pixel: nodes make colour images of gray ones
_UNPACKED_SHARE = 16  # small messages take several times their bytes
_FRAME_SHARE = 40  # a decoder may keep 16 frames beside the images
_OBJECT_BYTES = 256  # of a Python object and its copy
_MOST_GIB = 4096  # more than a computer has
_PLAUSIBLE = 2  # data may always unpack to so many times their size
_max_memory = DEFAULT_MEMORY
_most_frames = 1 << 16


def parse_memory(text: str) -> int:
    """Bytes, as ``4G`` or ``500M``.

    Raises:
        UsageError: invalid, or too small for anything.
    """
    found = re.fullmatch(r"(\d{1,15}(?:\.\d{1,6})?) ?([KMGT]?)(?:i?B)?", text, re.IGNORECASE)
    size = int(float(found[1]) * _UNITS[found[2].upper()]) if found else 0
    if size < _LEAST_MEMORY:
        raise UsageError(
            f"{text!r}: give a size such as 4G or 500M, at least {_LEAST_MEMORY >> 20}M"
        )
    return size


def set_max_memory(size: int) -> None:
    """Set the memory that one input may take, bytes (default: 2 GiB)."""
    global _max_memory
    _max_memory = size


def unpacked_limit(packed: int) -> int:
    """Most bytes that packed data of this size may unpack to."""
    return max(_max_memory // _UNPACKED_SHARE, _PLAUSIBLE * packed)


def check_unpacked(size: int, packed: int) -> None:
    """Check the unpacked size of packed data.

    Raises:
        TooLarge: it is above the limit.
    """
    if size > unpacked_limit(packed):
        raise TooLarge(f"unpacks to {_written(size)} or more{_advice(size, _UNPACKED_SHARE)}")


def check_image(width: int, height: int, pixel_bytes: int) -> None:
    """Check the size of an image before its pixels are made; gray counts as colour.

    Raises:
        TooLarge: they would take too much.
    """
    size = width * height * max(pixel_bytes, _COLOR_BYTES)
    if size > _max_memory // _SHARE:
        what = f"an image of {width}x{height} takes {_written(size)} in colour"
        raise TooLarge(f"{what}{_advice(size, _SHARE)}")


def check_frame(width: int, height: int, pixel_bits: int) -> None:
    """Check the size of a video's frames before one is decoded.

    Raises:
        TooLarge: a decoder, which may keep 16 of them beside the images, would take too much.
    """
    size = width * height * pixel_bits // 8
    if size > _max_memory // _FRAME_SHARE:
        what = f"frames of {width}x{height} take {_written(size)} each"
        raise TooLarge(f"{what}{_advice(size, _FRAME_SHARE)}")


def frame_pixels(pixel_bits: int) -> int:
    """The most pixels that a video's frame may have."""
    return _max_memory // _FRAME_SHARE * 8 // max(1, pixel_bits)


def frames_at_once(width: int, height: int, pixel_bits: int) -> int:
    """Number of frames of that size that a decoder may work on at once."""
    fitting = _max_memory // 2 // _SHARE * 8 // max(1, width * height * pixel_bits)
    return max(1, min(_most_frames, fitting))


def set_frames_at_once(most: int) -> None:
    """Set the number of frames that decoders may work on at once (default: by their size)."""
    global _most_frames
    _most_frames = most


def object_limit() -> int:
    """Most Python objects that one message may become."""
    return _max_memory // _OBJECT_BYTES


def max_memory() -> int:
    """Memory limit of this process, bytes."""
    return _max_memory


def _limit(what: str, share: int) -> Callable[[int], None]:
    """A check of an input's size before it is read; the check raises TooLarge."""

    def check(size: int) -> None:
        if size > _max_memory // share:
            raise TooLarge(f"{what} of {_written(size)}{_advice(size, share)}")

    return check


check_file = _limit("a file", _SHARE)
check_log = _limit("a flight log", 4)  # held twice
check_model = _limit("a network", 4)  # its weights may be copied in another layout
check_text = _limit("a text", 32)  # lines become objects of many times their size
check_numbers = _limit("numbers", 128)  # each is a word, an object and an entry


@contextmanager
def within_limits(name: object) -> Iterator[None]:
    """Within this, an input of that name that is TooLarge cannot be opened: raises OpenError."""
    try:
        yield
    except TooLarge as error:
        raise OpenError(f"{name}: {error}") from None


def disk_reserve(total: int) -> tuple[int, str]:
    """Bytes of a disk of this size that stay free for others, and the same in words."""
    return min((_GIB, "1 GiB"), (total // 20, "5%"))


def check_disk(folder: Path, size: int) -> None:
    """Check that a disk has room for a temporary file of this size.

    Raises:
        OpenError: it has too little.
    """
    disk = shutil.disk_usage(folder)
    if disk.free < size + disk_reserve(disk.total)[0]:
        raise OpenError(
            f"needs {_written(size)} or more in {folder}, where {_written(disk.free)} is free;"
            " make room, or set TMPDIR to a folder on a larger disk"
        )


def _advice(size: int, share: int) -> str:
    needed = math.ceil(size * share / _GIB)
    limit = f"; limit: {_written(_max_memory // share)}"
    if needed > _MOST_GIB:
        return f"{limit}; its declared size must be wrong; copy or record it again"
    return f"{limit}; if you trust it, add --max-memory {needed}G"


def _written(size: float) -> str:
    return f"{size / _GIB:.1f} GiB" if size >= _GIB else f"{size / _MIB:.0f} MiB"

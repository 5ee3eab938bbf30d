"""What one input may take of the machine: sizes that it declares are checked before it takes them.

All limits are shares of one number, `--max-memory`, so that a small input does not bring the whole
process above that.
"""

from __future__ import annotations

import math
import re
import shutil
from pathlib import Path

from ros_visualise.core.errors import OpenError, TooLarge, UsageError

DEFAULT_MEMORY = 2 << 30
MAX_TAG_M = 100.0
"""Side of a tag that has poses."""

_LEAST_MEMORY = 64 << 20
_UNITS = {"": 1, "K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}

_GIB, _MIB = 1 << 30, 1 << 20
_SHARE = 16  # several images are held at the same time
_COLOR_BYTES = 3  # of a pixel: nodes make colours of gray, and edges take as much
_UNPACKED_SHARE = 16  # small messages take several times their bytes
_MODEL_SHARE = 4  # its weights may be laid out anew beside those of the file
_TEXT_SHARE = 32  # as do lines of text
_NUMBERS_SHARE = 128  # each is a word, an object and an entry
_LOG_SHARE = 4  # is held twice
_FRAME_SHARE = 40  # a decoder may keep 16 frames beside the images
_OBJECT_BYTES = 256  # one of Python's is half of it, and may be made into another
_MOST_GIB = 4096  # more than a computer has: who says so has not counted it
_PLAUSIBLE = 2  # what is packed may always be unpacked to so many times its own size
_max_memory = DEFAULT_MEMORY


def parse_memory(text: str) -> int:
    """Bytes, as ``4G`` or ``500M``.

    Raises:
        UsageError: it is no size, or less than anything needs.
    """
    found = re.fullmatch(r"(\d{1,15}(?:\.\d{1,6})?) ?([KMGT]?)(?:i?B)?", text, re.IGNORECASE)
    size = int(float(found[1]) * _UNITS[found[2].upper()]) if found else 0
    if size < _LEAST_MEMORY:
        raise UsageError(f"{text!r}: give bytes as 4G or 500M, at least {_LEAST_MEMORY >> 20}M")
    return size


def set_max_memory(size: int) -> None:
    """Let this process take so many bytes."""
    global _max_memory
    _max_memory = size


def unpacked_limit(packed: int) -> int:
    """The bytes that may be made of so many packed ones."""
    return max(_max_memory // _UNPACKED_SHARE, _PLAUSIBLE * packed)


def check_unpacked(size: int, packed: int) -> None:
    """Look at what is said to unpack to so many bytes, or did.

    Raises:
        TooLarge: it may not.
    """
    if size > unpacked_limit(packed):
        raise TooLarge(f"unpacks to {_written(size)} or more, {_advice(size, _UNPACKED_SHARE)}")


def check_image(width: int, height: int, pixel_bytes: int) -> None:
    """Look at the size of an image before its pixels are made; gray counts as colour does.

    Raises:
        TooLarge: they would take too much.
    """
    size = width * height * max(pixel_bytes, _COLOR_BYTES)
    if size > _max_memory // _SHARE:
        what = f"an image of {width}x{height} takes {_written(size)} in colour"
        raise TooLarge(f"{what}, {_advice(size, _SHARE)}")


def check_frame(width: int, height: int, pixel_bits: int) -> None:
    """Look at the size of a video's frames before one is decoded.

    Raises:
        TooLarge: a decoder, which may keep 16 of them beside the images, would take too much.
    """
    size = width * height * pixel_bits // 8
    if size > _max_memory // _FRAME_SHARE:
        what = f"frames of {width}x{height} take {_written(size)} each"
        raise TooLarge(f"{what}, {_advice(size, _FRAME_SHARE)}")


def frame_pixels(pixel_bits: int) -> int:
    """The most pixels that a video's frame may have."""
    return _max_memory // _FRAME_SHARE * 8 // max(1, pixel_bits)


def frames_at_once(width: int, height: int, pixel_bits: int) -> int:
    """How many frames of that size a decoder may work on at the same time."""
    return max(1, _max_memory // 2 // _SHARE * 8 // max(1, width * height * pixel_bits))


def object_limit() -> int:
    """The objects that one message may become."""
    return _max_memory // _OBJECT_BYTES


def check_file(size: int) -> None:
    """Look at the size of a file that is read as a whole.

    Raises:
        TooLarge: it would take too much.
    """
    if size > _max_memory // _SHARE:
        raise TooLarge(f"a file of {_written(size)}, {_advice(size, _SHARE)}")


def max_memory() -> int:
    """The bytes that this process may take."""
    return _max_memory


def check_log(size: int) -> None:
    """Look at the size of a flight log, which is held as a whole while it is played.

    Raises:
        TooLarge: it would take too much.
    """
    if size > _max_memory // _LOG_SHARE:
        raise TooLarge(f"a flight log of {_written(size)}, {_advice(size, _LOG_SHARE)}")


def check_model(size: int) -> None:
    """Look at the size of a file with a network's weights, which are held once.

    Raises:
        TooLarge: they would take too much.
    """
    if size > _max_memory // _MODEL_SHARE:
        raise TooLarge(f"a network of {_written(size)}, {_advice(size, _MODEL_SHARE)}")


def check_text(size: int) -> None:
    """Look at the size of a file of text, whose lines become objects of many times their size.

    Raises:
        TooLarge: they would take too much.
    """
    if size > _max_memory // _TEXT_SHARE:
        raise TooLarge(f"a text of {_written(size)}, {_advice(size, _TEXT_SHARE)}")


def check_numbers(size: int) -> None:
    """Look at the size of a text of numbers, which may be of one digit each.

    Raises:
        TooLarge: they would take too much.
    """
    if size > _max_memory // _NUMBERS_SHARE:
        raise TooLarge(f"numbers of {_written(size)}, {_advice(size, _NUMBERS_SHARE)}")


def disk_reserve(total: int) -> tuple[int, str]:
    """How much of a disk of so many bytes stays free for others; in words, too."""
    return min((_GIB, "1 GiB"), (total // 20, "5%"))


def check_disk(folder: Path, size: int) -> None:
    """See that a disk has room for so many more bytes of a temporary file, and for others.

    Raises:
        OpenError: it has not.
    """
    disk = shutil.disk_usage(folder)
    if disk.free < size + disk_reserve(disk.total)[0]:
        raise OpenError(
            f"needs {_written(size)} or more in {folder}, where {_written(disk.free)} are free;"
            " make room, or set TMPDIR to a folder on a larger disk"
        )


def _advice(size: int, share: int) -> str:
    needed = math.ceil(size * share / _GIB)
    limit = _written(_max_memory // share)
    if needed > _MOST_GIB:
        return f"and {limit} are allowed: its size is damaged; copy or make it again"
    return f"and {limit} are allowed; if you trust it, add --max-memory {needed}G"


def _written(size: float) -> str:
    return f"{size / _GIB:.1f} GiB" if size >= _GIB else f"{size / _MIB:.0f} MiB"

"""Unpacking what recordings compress: to no more than was declared, and no more than is allowed."""

from __future__ import annotations

import bz2
from collections.abc import Callable

import lz4.frame  # type: ignore[import-untyped]
import zstandard

from ros_visualise.core.errors import TooLarge
from ros_visualise.core.limits import check_unpacked, unpacked_limit

Packed = bytes | memoryview

_FAULTS = (OSError, ValueError, EOFError, RuntimeError, MemoryError, zstandard.ZstdError)


class DamagedData(Exception):
    """Data of a file contradicts itself, its checksum or its declared length; says how."""


def unpack(compression: str, packed: Packed, size: int) -> bytes:
    """Unpack what is declared to make so many bytes.

    Args:
        compression: one of `COMPRESSIONS`.

    Raises:
        TooLarge: so many are not allowed.
        DamagedData: it cannot be unpacked, or is of another length.
    """
    check_unpacked(size, len(packed))
    found = _unpack(compression, packed, size + 1)
    if len(found) != size:
        raise DamagedData(f"its {compression} data does not have the declared size")
    return found


def unpack_all(compression: str, packed: Packed) -> bytes:
    """Unpack data of undeclared length, or which may be cut off.

    Raises:
        TooLarge: it is more than is allowed.
        DamagedData: it cannot be unpacked.
    """
    if compression == "zstd":
        check_unpacked(_declared_size(packed), len(packed))
    found = _unpack(compression, packed, unpacked_limit(len(packed)) + 1)
    check_unpacked(len(found), len(packed))
    return found


def unpack_chunk(compression: str, packed: Packed, size: int, is_cut: bool) -> bytes:
    """Unpack a chunk of ``size`` bytes, or what one that is cut off has; raises DamagedData."""
    try:
        return unpack_all(compression, packed) if is_cut else unpack(compression, packed, size)
    except TooLarge as error:
        raise DamagedData(str(error)) from error


def _unpack(compression: str, packed: Packed, most: int) -> bytes:
    try:
        return COMPRESSIONS[compression](packed, most)
    except _FAULTS as error:
        raise DamagedData(f"its {compression} data is damaged") from error


def _declared_size(packed: Packed) -> int:
    """The size that a zstd frame declares; -1 without one."""
    try:
        return zstandard.frame_content_size(packed)
    except zstandard.ZstdError:
        return -1


def _bz2(packed: Packed, most: int) -> bytes:
    return bz2.BZ2Decompressor().decompress(packed, most)


def _lz4(packed: Packed, most: int) -> bytes:
    context = lz4.frame.create_decompression_context()  # its class would copy what is packed
    return bytes(lz4.frame.decompress_chunk(context, packed, max_length=most)[0])


def _zstd(packed: Packed, most: int) -> bytes:
    return zstandard.ZstdDecompressor().stream_reader(packed).read(most)


COMPRESSIONS: dict[str, Callable[[Packed, int], bytes]] = {"bz2": _bz2, "lz4": _lz4, "zstd": _zstd}

"""The least length of a video file by its own boxes or packets; a shorter file was cut off."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import BinaryIO

from ros_visualise.core.regular_files import open_file

_BOX = struct.Struct(">I4s")
_LONG = struct.Struct(">Q")
_RIFF = struct.Struct("<4sI")
_BOXES = {b"ftyp", b"styp", b"moov", b"moof", b"mdat", b"mfra", b"free", b"skip", b"wide", b"uuid"}
_SYNC, _PACKET_BYTES = b"\x47", 188  # of MPEG-TS, which ends with a whole packet
_EBML, _SEGMENT = b"\x1a\x45\xdf\xa3", b"\x18\x53\x80\x67"


def promised_bytes(path: Path) -> int:
    """Least size of a file by its outermost boxes or packets; 0: unknown. FFmpeg does not check it.

    Source: ISO/IEC 14496-12, section 4.2, and 13818-1, 2.4.3; Microsoft, AVI RIFF File Reference;
    RFC 8794, sections 4 to 7.
    """
    with open_file(path) as file:
        head = file.read(_BOX.size)
        if head[4:] == b"ftyp":
            return _end_of_boxes(file)
        if head.startswith(b"RIFF"):
            return _end_of_riffs(file)
        if head.startswith(_SYNC) and _read(file, _PACKET_BYTES, 1) == _SYNC:
            return -(-path.stat().st_size // _PACKET_BYTES) * _PACKET_BYTES
        return _end_of_segment(file) if head.startswith(_EBML) else 0


def _end_of_boxes(file: BinaryIO) -> int:
    """MP4 and similar; a length of 1 means that 64 bits follow, 0 means all the rest."""
    end = 0
    while len(head := _read(file, end, _BOX.size + _LONG.size)) >= _BOX.size:
        length, kind = _BOX.unpack_from(head)
        if length == 1 and len(head) == _BOX.size + _LONG.size:
            (length,) = _LONG.unpack_from(head, _BOX.size)
        if kind not in _BOXES or length < _BOX.size:
            break
        end += length
    return end


def _end_of_riffs(file: BinaryIO) -> int:
    """AVI, of one part or several; an unfinished one has no length."""
    end = 0
    while len(head := _read(file, end, _RIFF.size)) == _RIFF.size:
        kind, length = _RIFF.unpack(head)
        if kind != b"RIFF" or not length:
            break
        end += _RIFF.size + length
    return end


def _end_of_segment(file: BinaryIO) -> int:
    """Matroska and WebM; the length of a live stream is not known."""
    header_bytes, at = _number(file, len(_EBML))
    start = at + (header_bytes or 0)
    if _read(file, start, len(_SEGMENT)) != _SEGMENT:
        return 0
    length, at = _number(file, start + len(_SEGMENT))
    return 0 if length is None else at + length


def _number(file: BinaryIO, place: int) -> tuple[int | None, int]:
    """A number whose first bits give its length, or None; and where it ends."""
    first = _read(file, place, 1)
    size = 9 - first[0].bit_length() if first and first[0] else 1
    value = int.from_bytes(_read(file, place, size), "big") & (1 << 7 * size) - 1
    return None if value == (1 << 7 * size) - 1 else value, place + size


def _read(file: BinaryIO, place: int, size: int) -> bytes:
    file.seek(place)
    return file.read(size)

"""Pictures before they are decoded: by its header, a kilobyte may expand to a gigabyte."""

from __future__ import annotations

import struct
import zlib
from io import BytesIO

from PIL import Image as Pictures
from PIL import UnidentifiedImageError

from ros_visualise.core.limits import check_image

_KINDS = ("JPEG", "PNG", "TIFF", "WEBP", "BMP", "PPM", "JPEG2000", "GIF")
_EXPANDED = ("P", "PA", "LA")  # modes of which OpenCV makes colours, perhaps with alpha
_DEEP = ("TIFF", "PPM", "JPEG2000")  # Pillow does not tell whether a colour has 8 bits or 16
_PNG_DEPTH_AT = 24
_PNG_START, _PNG_AROUND = b"\x89PNG\r\n\x1a\n", 12  # bytes around a part: length, kind, checksum
_PNG_SHOWN = (b"IHDR", b"PLTE", b"tRNS", b"eXIf", b"IDAT", b"IEND")
_JPEG_START, _JPEG_END = b"\xff\xd8", b"\xff\xd9"

Pictures.MAX_IMAGE_PIXELS = None  # the limit is ours


def decodable(file: bytes) -> bytes | None:
    """A file that OpenCV decodes without printing warnings; None if it is not a valid picture.

    A truncated JPEG is invalid: OpenCV would fill it up with gray. So is a truncated or damaged
    PNG, about which OpenCV's library would print warnings. Text chunks of a PNG are removed.

    Raises:
        TooLarge: its pixels would take too much memory.
    """
    try:
        with Pictures.open(BytesIO(file), formats=_KINDS) as picture:
            (width, height), pixel_bytes = picture.size, _pixel_bytes(file, picture)
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError):
        return None
    check_image(width, height, pixel_bytes)
    if file.startswith(_PNG_START):
        return _bare_png(file)
    return None if file.startswith(_JPEG_START) and _JPEG_END not in file else file


def _bare_png(file: bytes) -> bytes | None:
    """The chunks of a PNG that make its pixels; None if damaged."""
    kept, at = [file[: len(_PNG_START)]], len(_PNG_START)
    while at + _PNG_AROUND <= len(file):
        length, kind = struct.unpack_from(">I4s", file, at)
        end = at + _PNG_AROUND + length
        part = memoryview(file)[at:end]
        if end > len(file) or zlib.crc32(part[4:-4]) != int.from_bytes(part[-4:], "big"):
            return None
        if kind in _PNG_SHOWN:
            kept.append(bytes(part))
        if kind == b"IEND":
            return b"".join(kept)
        at = end
    return None


def _pixel_bytes(file: bytes, picture: Pictures.Image) -> int:
    """The most bytes that OpenCV makes of a pixel."""
    is_expanded = picture.mode in _EXPANDED or "transparency" in picture.info
    channels = 4 if is_expanded or picture.format == "GIF" else len(picture.getbands())
    if picture.mode == "F":
        return channels * 4
    is_deep = picture.format in _DEEP or (picture.format == "PNG" and file[_PNG_DEPTH_AT] == 16)
    return channels * (2 if is_deep else 1)

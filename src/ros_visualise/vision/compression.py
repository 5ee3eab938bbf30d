"""Images as JPEG and PNG, in the convention of ROS's compressed_image_transport.

``format`` says how the image was encoded before, and how the channels were put into the file:
``rgb8; jpeg compressed bgr8``, ``mono16; png compressed``. Many programs write ``jpeg`` alone.
Depth comes as compressed_depth_image_transport has it, too: ``32FC1; compressedDepth png``.
"""

from __future__ import annotations

import contextlib
import struct
import zlib
from io import BytesIO
from typing import Any

import cv2
import numpy as np
from PIL import Image as Pictures
from PIL import UnidentifiedImageError

from ros_visualise.core.limits import check_image
from ros_visualise.data import ENCODINGS, MEASUREMENTS, CompressedImage, Image, Pixels
from ros_visualise.vision.color import encoding_of, is_bayer, order_of, to_bgr

_LARGEST_JPEG = 65500  # pixels along a side
_DEPTH = "16UC1"
_DEPTH_HEADER = struct.Struct("<iff")  # an unused number, and the quantisation's A and B


JPEG_QUALITY = 80


def compress(image: Image, quality: int = JPEG_QUALITY) -> CompressedImage:
    """JPEG of 8-bit images, PNG of 16-bit ones and mosaics, whose values JPEG would mix.

    Alpha is dropped.

    Args:
        image: gray, colours, or depth in millimetres.
        quality: of a JPEG, 1 to 100.

    Raises:
        ValueError: the image has no pixels, or too many, or other measurements.
    """
    if image.encoding in MEASUREMENTS and image.encoding != _DEPTH:
        raise ValueError(f"{image.encoding} holds measurements, which JPEG and PNG cannot store")
    pixels, stored = image.pixels, ""
    if image.is_color:
        pixels = to_bgr(pixels, order_of(image.encoding))
        stored = encoding_of(pixels, "BGR")
    is_jpeg = pixels.dtype == np.uint8 and not is_bayer(image.encoding)
    if not pixels.size or (is_jpeg and max(pixels.shape) > _LARGEST_JPEG):
        raise ValueError(f"an image of {image.width}x{image.height} pixels cannot be compressed")
    if is_jpeg:
        data = _encode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])
    else:
        data = _encode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    kind = "jpeg" if is_jpeg else "png"
    return CompressedImage(data, f"{image.encoding}; {kind} compressed {stored}", image.header)


def decompress(compressed: CompressedImage) -> Image:
    """The image, in the encoding that its format names; where it names none, in that of the file.

    Raises:
        ValueError: the data is broken, or neither a picture in gray or colours nor depth.
    """
    encoding, named, how = (part.strip() for part in compressed.format.partition(";"))
    if "compressedDepth" in how:
        return _decompress_depth(compressed, encoding, how)
    pixels, order = _decode(compressed.data, compressed.format), "BGR"
    if encoding == _DEPTH and _is_gray_16(pixels):
        return Image(pixels, _DEPTH, compressed.header)
    if not named or encoding not in ENCODINGS:
        encoding = encoding_of(pixels, order)
    elif encoding.startswith(("bgr", "rgb")) and "compressed bgr" not in how:
        order = "RGB"  # so the transport's own subscriber has it: its first versions wrote that
    pixels, encoding = _as(pixels, order, encoding)
    return Image(pixels, encoding, compressed.header)


def _decompress_depth(compressed: CompressedImage, encoding: str, how: str) -> Image:
    """Depth: millimetres as they are, metres by the inverse depth that the file holds.

    Source: the transport's own decoder, which has A / (value - B), and 0 for no depth.
    """
    if encoding not in (_DEPTH, "32FC1") or "rvl" in how:
        raise ValueError(
            f"unsupported compressed depth {compressed.format!r}; use png with 16UC1 or 32FC1"
        )
    if compressed.data.size <= _DEPTH_HEADER.size:
        raise ValueError(_broken(compressed.format, compressed.data.size))
    values = _decode(compressed.data[_DEPTH_HEADER.size :], compressed.format)
    if not _is_gray_16(values):
        raise ValueError(f"compressed depth {compressed.format!r} is not a 16-bit gray image")
    if encoding == _DEPTH:
        return Image(values, _DEPTH, compressed.header)
    _, a, b = _DEPTH_HEADER.unpack_from(compressed.data.tobytes()[: _DEPTH_HEADER.size])
    inverse = np.where(values == 0, np.float32(np.nan), values.astype(np.float32))
    with np.errstate(divide="ignore", invalid="ignore"):
        return Image(np.float32(a) / (inverse - np.float32(b)), "32FC1", compressed.header)


def _is_gray_16(pixels: Pixels) -> bool:
    return pixels.dtype == np.uint16 and pixels.ndim == 2


def _encode(suffix: str, pixels: Pixels, options: list[int]) -> Pixels:
    _, data = cv2.imencode(suffix, pixels, options)
    encoded: Pixels = data.reshape(-1)
    return encoded


def _decode(file: Pixels, format_name: str) -> Pixels:
    """The picture in a file: gray, or colour in the order B, G, R, perhaps with alpha."""
    raw = decodable(file.tobytes())
    pixels: Any = None
    if raw is not None:
        with contextlib.suppress(cv2.error):
            pixels = cv2.imdecode(np.frombuffer(raw, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise ValueError(_broken(format_name, file.size))
    if pixels.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"compressed image {format_name!r} holds {pixels.dtype} values")
    found: Pixels = pixels
    return found


def _broken(format_name: str, size: int) -> str:
    return f"compressed image {format_name!r} of {size} bytes is damaged"


def _as(pixels: Pixels, order: str, encoding: str) -> tuple[Pixels, str]:
    """The picture in an encoding, at its own depth, and the name of that."""
    kind = encoding.rstrip("0123456789")
    name = f"{kind}{8 * pixels.dtype.itemsize}"
    if name not in ENCODINGS or (is_bayer(name) and pixels.ndim == 3):
        return pixels, encoding_of(pixels, order)
    source = order + ("A" if pixels.shape[2:] == (4,) else "") if pixels.ndim == 3 else "GRAY"
    target = "GRAY" if kind == "mono" or is_bayer(name) else kind.upper()
    if source != target:
        pixels = cv2.cvtColor(pixels, getattr(cv2, f"COLOR_{source}2{target}"))
    return pixels, name


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

"""The size of a picture by its header: a file of a kilobyte may expand to a gigabyte."""

from __future__ import annotations

from io import BytesIO

from PIL import Image as Pictures
from PIL import UnidentifiedImageError

from ros_visualise.limits import check_image

_KINDS = ("JPEG", "PNG", "TIFF", "WEBP", "BMP", "PPM", "JPEG2000", "GIF")
_EXPANDED = ("P", "PA", "LA")  # modes of which OpenCV makes colours, perhaps with alpha
_DEEP = ("TIFF", "PPM", "JPEG2000")  # Pillow does not tell whether a colour has 8 bits or 16
_PNG_DEPTH_AT = 24
_JPEG_START, _JPEG_END = b"\xff\xd8", b"\xff\xd9"

Pictures.MAX_IMAGE_PIXELS = None  # the limit is ours


def check_picture(file: bytes) -> bool:
    """Check a picture before OpenCV decodes it; returns whether it is one.

    A JPEG without its end is none: OpenCV would fill up what lacks with gray.

    Raises:
        TooLarge: its pixels would take too much.
    """
    try:
        with Pictures.open(BytesIO(file), formats=_KINDS) as picture:
            (width, height), pixel_bytes = picture.size, _pixel_bytes(file, picture)
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError):
        return False
    check_image(width, height, pixel_bytes)
    return not file.startswith(_JPEG_START) or _JPEG_END in file


def _pixel_bytes(file: bytes, picture: Pictures.Image) -> int:
    """The most bytes that OpenCV makes of a pixel."""
    is_expanded = picture.mode in _EXPANDED or "transparency" in picture.info
    channels = 4 if is_expanded or picture.format == "GIF" else len(picture.getbands())
    if picture.mode == "F":
        return channels * 4
    is_deep = picture.format in _DEEP or (picture.format == "PNG" and file[_PNG_DEPTH_AT] == 16)
    return channels * (2 if is_deep else 1)

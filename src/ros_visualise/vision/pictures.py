"""How large the picture in a file is, by its head: a kilobyte can say that it is a gigabyte."""

from __future__ import annotations

from io import BytesIO

from PIL import Image as Pictures
from PIL import UnidentifiedImageError

from ros_visualise.limits import check_image

_KINDS = ("JPEG", "PNG", "TIFF", "WEBP", "BMP", "PPM", "JPEG2000", "GIF")

Pictures.MAX_IMAGE_PIXELS = None  # the limit is ours


def check_picture(file: bytes) -> bool:
    """Look at a picture before it is decoded; whether it is one.

    Raises:
        TooLarge: its pixels would take too much.
    """
    try:
        with Pictures.open(BytesIO(file), formats=_KINDS) as picture:
            (width, height), channels = picture.size, len(picture.getbands())
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError):
        return False
    check_image(width, height, channels)
    return True

"""Decoded video frames to images; swscale converts pixels when they are first read."""

from __future__ import annotations

import re
import threading
from functools import partial
from typing import Any

import cv2
import numpy as np
from av.video.frame import VideoFrame
from av.video.reformatter import VideoReformatter

from ros_visualise.core.errors import TooLarge, UsageError
from ros_visualise.core.limits import check_image
from ros_visualise.data import ENCODINGS, Deferred, Image, Pixels

Size = tuple[int, int]

_MAX_SIDE = 16384
_PIXEL_FORMATS = {"mono8": "gray", "mono16": "gray16le", "bgr8": "bgr24"}
_QUARTER_TURNS = {
    1: cv2.ROTATE_90_COUNTERCLOCKWISE,
    2: cv2.ROTATE_180,
    3: cv2.ROTATE_90_CLOCKWISE,
}


def parse_size(text: str) -> Size | None:
    """``WxH`` in pixels; None for an empty text; raises UsageError."""
    if not text:
        return None
    found = re.fullmatch(r"(\d{1,5})[xX](\d{1,5})", text.strip())
    width, height = map(int, found.groups()) if found else (0, 0)
    if not (0 < width <= _MAX_SIDE and 0 < height <= _MAX_SIDE):
        raise UsageError(
            f"size={text}: give WIDTHxHEIGHT in pixels, such as 640x480, at most {_MAX_SIDE} each"
        )
    try:
        check_image(width, height, ENCODINGS["bgr8"][1])
    except TooLarge as error:
        raise UsageError(f"size={text}: {error}") from None
    return width, height


class _Local(threading.local):
    """A reformatter serves one thread at a time."""

    def __init__(self) -> None:
        self.reformatter = VideoReformatter()


class FrameConverter:
    """Makes images from video frames; scaled at once to a size, else converted when first read."""

    def __init__(self, size: Size | None = None) -> None:
        self._size = size
        self._local = _Local()

    def image(self, frame: VideoFrame) -> Image:
        """The image of a frame, upright."""
        encoding = _encoding(frame)
        if self._size is not None:
            return Image(self._pixels(frame, encoding), encoding)
        shape = upright_size(frame)[::-1] + ENCODINGS[encoding][1:] * (encoding == "bgr8")
        dtype = ENCODINGS[encoding][0]
        return Image(Deferred(shape, dtype, partial(self._pixels, frame, encoding)), encoding)

    def _pixels(self, frame: VideoFrame, encoding: str) -> Pixels:
        turns = quarter_turns(frame)
        width, height = self._size or upright_size(frame)
        if turns % 2:
            width, height = height, width
        how = "BICUBIC" if self._size is None else "BILINEAR"  # FFmpeg's own choice for colours
        scaled = self._local.reformatter.reformat(
            frame, width, height, _PIXEL_FORMATS[encoding], interpolation=how
        )
        pixels: Any = _plane(scaled, encoding)
        upright: Pixels = cv2.rotate(pixels, _QUARTER_TURNS[turns]) if turns else pixels
        return upright


def quarter_turns(frame: VideoFrame) -> int:
    """Number of counterclockwise quarter turns that make a frame upright."""
    return round(frame.rotation / 90) % 4


def upright_size(frame: VideoFrame) -> Size:
    """Width and height of a frame as it is shown."""
    size = (frame.width, frame.height)
    return size[::-1] if quarter_turns(frame) % 2 else size


def _encoding(frame: VideoFrame) -> str:
    if not re.match("gray|mono|y[a0-9]|ya", frame.format.name):
        return "bgr8"
    return "mono16" if frame.format.components[0].bits > 8 else "mono8"


def _plane(frame: VideoFrame, encoding: str) -> Pixels:
    """The pixels of a packed frame, not copied."""
    name, channels = ENCODINGS[encoding]
    dtype = np.dtype(name)
    plane: Any = frame.planes[0]
    rows = np.frombuffer(plane, dtype).reshape(frame.height, -1)
    pixels: Pixels = rows[:, : frame.width * channels]
    return pixels.reshape(frame.height, frame.width, 3) if channels == 3 else pixels

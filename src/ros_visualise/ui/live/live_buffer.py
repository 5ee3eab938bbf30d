"""The messages of the last minutes of a live graph, within a limit of memory."""

from __future__ import annotations

import threading
from bisect import bisect_left, bisect_right
from collections.abc import Generator
from typing import Any, NamedTuple

import cv2
import numpy as np
import zstandard

from ros_visualise.core.message import OBJECT_BYTES
from ros_visualise.data import CameraInfo, Header, Image, Pixels, Transforms
from ros_visualise.data.images import Deferred
from ros_visualise.messages.recorded import content

LONGEST_NS = 600 * 1_000_000_000
_QUALITY = 90
_LOSSY = ("mono8", "bgr8", "rgb8")
_TRANSFORMS_NS = 10_000_000_000
"""All transforms of that time are shown together, as each publisher sends its own."""


class Kept(NamedTuple):
    """A message, the time at which it came, ns from the first one, and its size."""

    place_ns: int
    topic: str
    message: Any
    nbytes: int


class PackedImage(NamedTuple):
    """An image whose pixels are kept as JPEG, or compressed without loss."""

    header: Header
    encoding: str
    camera_info: CameraInfo | None
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    data: bytes

    def unpacked(self) -> Image:
        """The image again; its pixels are made when they are needed."""
        pixels = Deferred(self.shape, self.dtype, self._pixels)
        return Image(pixels, self.encoding, self.header, self.camera_info)

    def _pixels(self) -> Pixels:
        if self.encoding in _LOSSY:
            written = np.frombuffer(self.data, np.uint8)
            return np.asarray(cv2.imdecode(written, cv2.IMREAD_UNCHANGED)).reshape(self.shape)
        plain = zstandard.ZstdDecompressor().decompress(self.data)
        return np.frombuffer(plain, self.dtype).reshape(self.shape)


def packed(message: Any) -> tuple[Any, int]:
    """A message as it is kept, and its size: images are packed, others stay as they are.

    Raises:
        DamagedMessage: a recorded image that cannot be decoded.
    """
    image = content(message) if _is_image(message) else None
    if not isinstance(image, Image) or not image.pixels.size:
        return message, message.nbytes
    pixels = image.pixels
    if image.encoding in _LOSSY:
        how = [cv2.IMWRITE_JPEG_QUALITY, _QUALITY]
        data = cv2.imencode(".jpg", pixels, how)[1].tobytes()
    else:
        data = zstandard.ZstdCompressor(1).compress(pixels.tobytes())
    about = image.header, image.encoding, image.camera_info, pixels.shape, pixels.dtype
    return PackedImage(*about, data), len(data) + OBJECT_BYTES


def _is_image(message: Any) -> bool:
    return isinstance(message, Image) or getattr(message, "type_name", "") == Image.type_name


class LiveBuffer:
    """Keeps the newest messages; a `Playable`, so that they can be played again.

    Args:
        most_bytes: most memory that they take; the oldest are dropped first.
    """

    def __init__(self, most_bytes: int) -> None:
        self.most_bytes, self.nbytes = most_bytes, 0
        self._kept: list[Kept] = []
        self._places_ns: list[int] = []
        self._first = 0  # number of the first one
        self._before: dict[str, Kept] = {}  # topic -> the last one that was dropped
        self._lock = threading.Lock()

    @property
    def begin_ns(self) -> int:
        """Time of the oldest message."""
        with self._lock:
            return self._places_ns[0] if self._places_ns else 0

    @property
    def duration_ns(self) -> int:
        """Time of the newest message."""
        with self._lock:
            return self._places_ns[-1] if self._places_ns else 0

    def add(self, place_ns: int, topic: str, message: Any) -> None:
        """Keep a message; of the time of the one before if that is later."""
        packed_one, nbytes = packed(message)
        with self._lock:
            place_ns = max(place_ns, self._places_ns[-1] if self._places_ns else 0)
            self._kept.append(Kept(place_ns, topic, packed_one, nbytes))
            self._places_ns.append(place_ns)
            self.nbytes += nbytes
            self._drop_oldest(place_ns - LONGEST_NS)

    def since(self, number: int, most: int) -> tuple[int, tuple[Kept, ...]]:
        """Messages from a number on, counted from 0, that are still kept; the number of the first.

        Args:
            most: number of them.
        """
        with self._lock:
            number = max(number, self._first)
            return number, tuple(self._kept[number - self._first :][:most])

    def read(self, start_ns: int) -> Generator[tuple[int, tuple[Kept, ...]], None, None]:
        """(Time, messages): at first those shown at a time, then each one after it.

        Where there are no more, an empty batch of the newest time comes, and reading goes on.
        """
        with self._lock:
            number = self._first + bisect_right(self._places_ns, start_ns)
            shown = self._shown(number)
        if shown:
            yield shown[-1].place_ns, shown
        while True:
            found = self._next(number)
            if found is None:
                yield self.duration_ns, ()
            else:
                number, kept = found
                yield kept.place_ns, (kept,)

    def _drop_oldest(self, before_ns: int) -> None:
        count = bisect_left(self._places_ns, before_ns)
        nbytes = self.nbytes - sum(one.nbytes for one in self._kept[:count])
        while nbytes > self.most_bytes and count < len(self._kept) - 1:
            nbytes -= self._kept[count].nbytes
            count += 1
        for one in self._kept[:count]:
            self._before[one.topic] = one
        del self._kept[:count], self._places_ns[:count]
        self._first, self.nbytes = self._first + count, nbytes

    def _next(self, number: int) -> tuple[int, Kept] | None:
        """A message, or the oldest if it has been dropped, and the number of the next one."""
        with self._lock:
            number = max(number, self._first)
            at = number - self._first
            return (number + 1, self._kept[at]) if at < len(self._kept) else None

    def _shown(self, until: int) -> tuple[Kept, ...]:
        """The last message of each topic before a number, and the last seconds' transforms."""
        last: dict[str, Kept] = dict(self._before)
        kept = self._kept[: until - self._first]
        last |= {one.topic: one for one in kept}
        since_ns = kept[-1].place_ns - _TRANSFORMS_NS if kept else 0
        first = bisect_left(self._places_ns, since_ns)
        recent = [one for one in kept[first:] if _is_transforms(one.message)]
        found = {id(one): one for one in (*last.values(), *recent)}
        return tuple(sorted(found.values(), key=lambda one: one.place_ns))


def _is_transforms(message: Any) -> bool:
    return isinstance(message, Transforms) or getattr(message, "type_name", "") in (
        Transforms.type_name,
        *Transforms.also_read,
    )

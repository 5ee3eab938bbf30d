"""The difference of two topics' images."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

import cv2
import numpy as np

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.data import MEASUREMENTS, Image, Pixels
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.preview import preview
from ros_visualise.vision.color import order_of

_DEPTH = 8  # images of a topic, among which that of a stamp is looked for
_PATIENCE_S = 0.5


class Difference:
    """Images of two topics, subtracted as soon as both have one of the same stamp.

    Topics without common stamps, as of two cameras, are subtracted by the nearest stamps.

    Attributes:
        apart_ns: how much later the other image of the last difference is.
    """

    def __init__(
        self, runtime: Runtime, topic: str, other: str, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._subscriptions = [runtime.subscribe(one, _DEPTH) for one in (topic, other)]
        self._kept: list[deque[Image]] = [deque(maxlen=_DEPTH), deque(maxlen=_DEPTH)]
        self._clock, self._matched_s = clock, float("-inf")
        self.apart_ns = 0

    def take(self, timeout_s: float) -> Image | None:
        """The next difference; None if none came in time. Raises RosVisualiseError."""
        is_new = False
        for subscription, kept in zip(self._subscriptions, self._kept, strict=True):
            while (image := subscription.take(timeout_s)) is not None:
                kept.append(image)
                is_new = True
        ones, others = self._kept
        if not (is_new and ones and others):
            return None
        for one in reversed(ones):
            for other in reversed(others):
                if one.header.stamp_ns == other.header.stamp_ns:
                    self._matched_s, self.apart_ns = self._clock(), 0
                    return subtract(one, other)
        if self._clock() - self._matched_s < _PATIENCE_S:
            return None
        one = ones[-1]
        other = min(others, key=lambda it: abs(it.header.stamp_ns - one.header.stamp_ns))
        self.apart_ns = other.header.stamp_ns - one.header.stamp_ns
        return subtract(one, other)

    def notify(self, heard: Callable[[], None]) -> None:
        """Call this whenever an image comes, on the thread that publishes it."""
        for subscription in self._subscriptions:
            subscription.notify(heard)

    def close(self) -> None:
        """Unsubscribe."""
        for subscription in self._subscriptions:
            subscription.close()


def subtract(one: Image, other: Image) -> Image:
    """The absolute difference: of values where both have the same kind, else of what is shown.

    Raises:
        RosVisualiseError: they differ in size, or only one holds measurements.
    """
    if (one.width, one.height) != (other.width, other.height):
        raise RosVisualiseError("the images differ in size; choose Wipe")
    is_measured = one.encoding in MEASUREMENTS
    if is_measured != (other.encoding in MEASUREMENTS):
        raise RosVisualiseError(
            "measurements and gray levels cannot be subtracted from each other; choose Wipe"
        )
    first, second, encoding = one.pixels, other.pixels, one.encoding
    if first.dtype != second.dtype or first.shape != second.shape:
        if is_measured:
            raise RosVisualiseError(
                "measurements of different types cannot be subtracted from each other"
            )
        first, second, encoding = _seen(one), _seen(other), "bgr8"
    elif order_of(one.encoding) != order_of(other.encoding) and first.ndim == 3:
        second = cv2.cvtColor(
            second, cv2.COLOR_RGBA2BGRA if second.shape[2] == 4 else cv2.COLOR_RGB2BGR
        )
    found: Pixels = cv2.absdiff(np.ascontiguousarray(first), np.ascontiguousarray(second))
    if is_measured:
        missing = (first == 0) | (second == 0)
        found[missing] = np.nan if found.dtype.kind == "f" else 0
    return Image(found.reshape(first.shape), encoding, one.header)


def _seen(image: Image) -> Pixels:
    pixels = preview(image, 2**30)
    return pixels if pixels.ndim == 3 else cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR)

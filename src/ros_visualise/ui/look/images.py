"""Unscaled images, for a browser that inspects them."""

from __future__ import annotations

import json
import sys

import cv2
import numpy as np

from ros_visualise.data import MEASUREMENTS, Image, Pixels
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.live.taps import Taps
from ros_visualise.ui.preview import preview
from ros_visualise.ui.server.answers import Answer, BrowserQuery, Refusal
from ros_visualise.vision.color import order_of, to_bgr

_DEPTH = 8  # images of a topic, among which that of a stamp is looked for
_WAIT_S = 1.0
_MAX_BYTES = 256 << 20


class Images:
    """Answers with the pixels of a topic's images.

    A query names the topic and, to compare it with another's, the ``stamp``; with ``near``, the
    nearest stamp will do. With ``after``, the stamp of the present image, nothing is sent twice.
    """

    def __init__(self, runtime: Runtime) -> None:
        self._runtime = runtime
        self._taps = Taps(runtime, _DEPTH)

    def rest(self, all_of_them: bool = False) -> None:
        """Unsubscribe from topics without recent queries."""
        self._taps.rest(all_of_them)

    @property
    def topics(self) -> list[str]:
        return [name for name, one in self._runtime.graph.topics.items() if one.type is Image]

    def pixels(self, query: BrowserQuery) -> Answer:
        """The pixels in their order in memory, little-endian; a header describes them."""
        image = self._find(query)
        if image.header.stamp_ns == query.whole("after"):
            return Answer(b"", status=204)
        pixels = np.ascontiguousarray(image.pixels)
        if pixels.nbytes > _MAX_BYTES:
            raise Refusal("the image is too large to send", 413)
        if sys.byteorder == "big":
            pixels = pixels.byteswap()
        body = pixels.reshape(-1).view(np.uint8).data  # not copied for each who asks
        return Answer(body, "application/octet-stream", 200, _describe(image))

    def png(self, query: BrowserQuery) -> Answer:
        """The image as a PNG file: 8 and 16 bits unchanged, measurements in colours."""
        image = self._find(query)
        is_measured = image.encoding in MEASUREMENTS and image.encoding != "16UC1"
        done, data = cv2.imencode(".png", preview(image, 2**30) if is_measured else _plain(image))
        if not done:
            raise Refusal("the image cannot be written as PNG", 500)
        name = f"{image_name(query.text('topic'))}_{image.header.stamp_ns}.png"
        saved = {"Content-Disposition": f'attachment; filename="{name}"'}
        return Answer(data.tobytes(), "image/png", 200, saved)

    def _find(self, query: BrowserQuery) -> Image:
        topic, stamp_ns = query.text("topic"), query.whole("stamp")
        if topic not in self.topics:
            raise Refusal("no such image topic", 404)
        if stamp_ns is None:
            found = self._taps.newest(topic, _WAIT_S)
        elif "near" in query:
            found = self._taps.near(topic, stamp_ns)
        else:
            found = self._taps.at(topic, stamp_ns, _WAIT_S)
        if found is None:
            raise Refusal(
                "no image yet" if stamp_ns is None else "no image with that timestamp", 404
            )
        assert isinstance(found, Image)
        if not found.pixels.size:
            raise Refusal("the image has no pixels", 404)
        return found


def image_name(topic: str) -> str:
    """A topic as part of a file's name."""
    letters = (letter if letter.isascii() and letter.isalnum() else "_" for letter in topic)
    return "".join(letters).strip("_")[:80] or "image"


def _describe(image: Image) -> dict[str, str]:
    facts = {
        "width": image.width,
        "height": image.height,
        "channels": image.pixels.shape[2] if image.is_color else 1,
        "dtype": str(image.pixels.dtype),
        "encoding": image.encoding,
        "measured": image.encoding in MEASUREMENTS,
        "stamp": str(image.header.stamp_ns),  # more digits than JavaScript's numbers hold
    }
    return {"X-Image": json.dumps(facts)}


def _plain(image: Image) -> Pixels:
    """The pixels for OpenCV: gray, BGR or BGRA."""
    pixels = image.pixels
    if pixels.ndim == 2:
        return pixels
    if pixels.shape[2] == 4 and order_of(image.encoding).startswith("RGB"):
        return cv2.cvtColor(pixels, cv2.COLOR_RGBA2BGRA)
    return pixels if pixels.shape[2] == 4 else to_bgr(pixels, order_of(image.encoding))

"""One image as browsers show it: drawn and encoded once for all of them."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import cv2

from ros_visualise.core import supervision
from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.data import MEASUREMENTS, Image, Pixels
from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.topics import Subscription
from ros_visualise.ui.boxes import Boxes
from ros_visualise.ui.live.difference import Difference
from ros_visualise.ui.live.overlay import Overlay
from ros_visualise.ui.live.space.shown import ShownSpace
from ros_visualise.ui.preview import preview, rgb_preview, stretched
from ros_visualise.ui.shown import detections_of

log = logging.getLogger(__name__)

_PERIOD_S = 1 / 40
_IDLE_S, _IDLE_OVERLAY_S = 1.0, 1 / 30
_SHORT_S = 0.0005  # computing after which no pause is needed
_MOST_PIXELS = 4096
_LETTERS = 300  # of a problem
_QUALITY, _QUALITY_NEAR = 85, 95
_NEAR = 4  # pixels of the screen for one of the image, from which colours are sent unreduced


class ImageView(NamedTuple):
    """An image as browsers ask for it.

    Attributes:
        topic: of the images.
        minus: topic of other images, which are subtracted; empty: none.
        cloud: topic of the clouds that are drawn over them; empty: none.
        boxes: detections are drawn over them.
        stretch: contrast is stretched to the usual values.
    """

    topic: str
    minus: str = ""
    cloud: str = ""
    boxes: bool = True
    stretch: bool = False


class Picture(NamedTuple):
    """An encoded image: its number, what is said of it, the JPEG, and the image itself."""

    number: int
    facts: Mapping[str, Any]
    jpeg: bytes
    image: Image | None


class ImageChannel:
    """The newest image of a view, made on a thread of its own until it is closed.

    Args:
        put: takes each picture, on that thread.
        rest: returns the seconds of pause for each second of computing.

    Attributes:
        size: longer side of the image in the largest browser that shows it, screen pixels.
        is_ready: whether a browser can take another image now. Both are set from outside.
    """

    def __init__(
        self,
        view: ImageView,
        runtime: Runtime,
        shown: ShownSpace,
        put: Callable[[Picture], None],
        rest: Callable[[], float],
    ) -> None:
        self.size, self.is_ready = 0, False
        self.changed = threading.Event()
        self._view, self._runtime, self._scene = view, runtime, shown
        self._put, self._rest = put, rest
        self._number, self._drawn = 0, 0
        self._image: Image | None = None
        self._problem = ""
        self._closed = threading.Event()
        self._images: Subscription | Difference
        self._early: Image | None = None
        supervision.start(f"image {view.topic}", self._run)

    def close(self) -> None:
        """End it, without waiting."""
        self._closed.set()
        self.changed.set()

    def preview(self, image: Image) -> None:
        """Show an image until the next one of the topic comes."""
        self._early = image
        self.changed.set()

    def _run(self) -> None:
        view, runtime = self._view, self._runtime
        boxes = partial(detections_of, runtime.graph) if view.boxes else _no_boxes
        self._overlay = Overlay(runtime, self._scene, view.cloud)
        self._boxes = Boxes(runtime, boxes)
        try:
            if view.minus:
                self._images = Difference(runtime, view.topic, view.minus)
            else:
                self._images = runtime.subscribe(view.topic)
        except KeyError:  # the graph has just changed
            return
        self._images.notify(self.changed.set)
        idle_s = _IDLE_OVERLAY_S if view.cloud or boxes(view.topic) else _IDLE_S
        try:
            while not self._closed.is_set():
                if self.is_ready:
                    self._closed.wait(self._do_round())
                self.changed.wait(idle_s)
                self.changed.clear()
        finally:
            self._images.close()
            self._overlay.close()
            self._boxes.rest()

    def _do_round(self) -> float:
        """Show the newest image, or the last one in a new size; the pause before the next."""
        start_s, start_cpu_s = time.perf_counter(), time.thread_time()
        is_early = self._early is not None
        try:
            self._refresh()
        except supervision.ERRORS as error:  # a damaged image does not stop the next one
            self._fail(error)
        spent_s, cpu_s = time.perf_counter() - start_s, time.thread_time() - start_cpu_s
        if is_early or cpu_s <= _SHORT_S:  # the exact image comes soon
            return 0.0
        return max(_PERIOD_S - spent_s, self._rest() * cpu_s)

    def _refresh(self) -> None:
        early, self._early = self._early, None
        is_other = self._boxes.refresh(self._view.topic) | self._overlay.refresh()
        found = self._boxes.choose(self._images.take(0))
        if found is None and early is not None:
            self._image, self._drawn = early, self.size
            self._show(early, preview=True)
            return
        image = found or self._image
        is_changed = found is not None or is_other or self.size != self._drawn
        if image is not None and is_changed:
            self._image, self._drawn = image, self.size
            self._show(image)

    def _show(self, image: Image, **more: Any) -> None:
        if not image.pixels.size:
            raise RosVisualiseError("the image has no pixels")
        size = min(self._drawn, _MOST_PIXELS)
        is_near = self._drawn >= _NEAR * max(image.width, image.height)
        how = [cv2.IMWRITE_JPEG_QUALITY, _QUALITY_NEAR if is_near else _QUALITY]
        if is_near:
            how += [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
        jpeg = cv2.imencode(".jpg", self._draw(image, size), how)[1].tobytes()
        self._send({**describe(image), **more}, jpeg, image)

    def _draw(self, image: Image, size: int) -> Pixels:
        """The image as it is shown, gray or BGR."""
        view = self._view
        if view.stretch and image.encoding not in MEASUREMENTS:
            image = stretched(image)
        if self._overlay.is_empty and not self._boxes.has(image):
            return preview(image, size)
        shown = self._overlay.draw(image, view.topic, rgb_preview(image, size))
        return cv2.cvtColor(self._boxes.draw(image, shown), cv2.COLOR_RGB2BGR)

    def _fail(self, error: BaseException) -> None:
        if str(error) != self._problem:
            self._problem = str(error)
            self._send({"problem": self._problem[:_LETTERS]}, b"", None)
            log.warning(
                "%s not shown: %s (further occurrences suppressed)", self._view.topic, error
            )

    def _send(self, facts: dict[str, Any], jpeg: bytes, image: Image | None) -> None:
        self._number += 1
        if isinstance(self._images, Difference):
            facts["apart"] = self._images.apart_ns / 1e6
        self._put(Picture(self._number, facts, jpeg, image))


def describe(image: Image) -> dict[str, Any]:
    """The facts of an image for browsers; stamps have more digits than JavaScript's numbers."""
    stamp = str(image.header.stamp_ns)
    return {
        "width": image.width,
        "height": image.height,
        "encoding": image.encoding,
        "stamp": stamp,
    }


def _no_boxes(_: str) -> Sequence[str]:
    return ()

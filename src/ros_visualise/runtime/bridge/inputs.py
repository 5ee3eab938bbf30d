"""Inputs of a process: messages from the graph."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.data import CameraInfo, CompressedImage, Image
from ros_visualise.messages.calibrations import info_topic
from ros_visualise.runtime.middleware import Handle, Subscriber, Transport
from ros_visualise.vision.compression import decompress

log = logging.getLogger(__name__)

Feed = Callable[[Any], None]
"""Takes the messages of one topic."""

_LOG_AGAIN_S = 10.0
_REASONS = 8
_INFO_WAIT_S = 1.0  # the first image waits for its calibration
_LARGE_BYTES = 20_000_000  # the sockets of a connection hold no more than one such image


class Input:
    """Feeds a topic of this process with messages from the graph, from `open` to `close`.

    Args:
        transport: of the graph.
        name: of the topic, in the node's words.
        kind: class of its messages.
        feed: takes them.

    Attributes:
        refused: rejected messages, which contradict themselves.
    """

    def __init__(self, transport: Transport, name: str, kind: type, feed: Feed) -> None:
        self.refused = 0
        self._name = transport.resolve(name)
        self._transport = transport
        self._topic, self._kind, self._feed = name, kind, feed
        self._logged_s: dict[str, float] = {}
        self._subscriber: Subscriber | None = None
        self._dropped = 0  # by subscribers that are closed

    def open(self) -> None:
        """Subscribe; messages may come before this returns."""
        self._subscriber = self._transport.subscribe(
            self._topic, self._kind, self._take, self._refuse
        )

    @property
    def dropped(self) -> int:
        """Messages dropped for newer ones."""
        return self._dropped + (0 if self._subscriber is None else self._subscriber.dropped)

    def _take(self, message: Any) -> None:
        try:
            self._feed(message)
        except RosVisualiseError as error:  # a source rejects it
            self._refuse(str(error))

    def _refuse(self, why: str) -> None:
        """Count a rejected message; each of the first few reasons is logged now and then."""
        self.refused += 1
        is_known = why in self._logged_s or len(self._logged_s) < _REASONS
        reason, now_s = why if is_known else "", time.monotonic()
        if now_s - self._logged_s.get(reason, -_LOG_AGAIN_S) >= _LOG_AGAIN_S:
            self._logged_s[reason] = now_s
            log.warning("%s: %s", self._name, why)

    def close(self) -> None:
        """Unsubscribe."""
        subscriber, self._subscriber = self._subscriber, None
        if subscriber is not None:
            subscriber.close()
            self._dropped += subscriber.dropped


class ImageInput(Input):
    """Feeds a topic with images, raw or compressed, and their calibration where it is needed.

    A calibration belongs to a camera, not to a time: an image gets the newest one of its size.

    Args:
        transport: of the graph.
        name: of the topic, in the node's words.
        resolved: its name on the graph.
        feed: takes the images.
        compressed: subscribe to ``<name>/compressed`` instead.
        wait_for_room: returns when there is time for another image.
        calibrated: the calibration is always needed; the first image waits for it a while.
    """

    def __init__(
        self,
        transport: Transport,
        name: str,
        resolved: str,
        feed: Feed,
        compressed: bool,
        wait_for_room: Callable[[], None] = lambda: None,
        calibrated: bool = False,
    ) -> None:
        topic = f"{resolved}/compressed" if compressed else name
        super().__init__(transport, topic, CompressedImage if compressed else Image, feed)
        self._calibrated = calibrated
        self._awaits_info = calibrated
        self._got_info = threading.Event()
        self._wait_for_room = wait_for_room
        self._info_name = info_topic(resolved)
        self._info_subscriber: Handle | None = None
        self._info: CameraInfo | None = None

    def open(self) -> None:
        """Subscribe, to the calibration first if it is always needed."""
        self.want_info(self._calibrated)
        super().open()

    def want_info(self, wanted: bool) -> None:
        """Subscribe to the calibration, or no longer, unless it is always needed."""
        self._follow_info(wanted or self._calibrated)

    def _follow_info(self, wanted: bool) -> None:
        if wanted and self._info_subscriber is None:
            self._info_subscriber = self._transport.subscribe(
                self._info_name, CameraInfo, self._take_info, self._refuse
            )
        elif not wanted and self._info_subscriber is not None:
            self._info_subscriber.close()
            self._info_subscriber = self._info = None

    def close(self) -> None:
        """Unsubscribe, from the calibration too."""
        self._got_info.set()
        super().close()
        self._follow_info(False)

    def _take(self, message: Image | CompressedImage) -> None:
        """Feed an image; the next large one is read when there is time for it.

        So images are dropped by their publisher, before they are sent. Small ones are always read:
        the sockets would hold many of them, which would grow old.
        """
        if self._awaits_info:
            self._got_info.wait(_INFO_WAIT_S)
            self._awaits_info = False
        try:
            super()._take(self._with_info(message))
        except ValueError as error:
            self._refuse(str(error))
        if message.nbytes >= _LARGE_BYTES:
            self._wait_for_room()

    def _with_info(self, message: Image | CompressedImage) -> Image:
        image = decompress(message) if isinstance(message, CompressedImage) else message
        info = self._info
        if info is None or (info.height, info.width) != (image.height, image.width):
            return image
        return replace(image, camera_info=info)

    def _take_info(self, info: CameraInfo) -> None:
        self._info = info if info.K.any() else None  # all zero: not calibrated
        self._got_info.set()

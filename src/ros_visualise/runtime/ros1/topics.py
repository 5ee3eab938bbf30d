"""What joins the topics inside this process to those of the ROS graph.

Nothing is converted, encoded or sent that nobody has subscribed to.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import rospy

from ros_visualise.data import CameraInfo, CompressedImage, Header, Image, Text
from ros_visualise.errors import DamagedMessage, RosVisualiseError
from ros_visualise.messages import from_message, to_message
from ros_visualise.messages.calibrations import info_topic
from ros_visualise.messages.recorded import content
from ros_visualise.runtime.queues import Inbox, Packet
from ros_visualise.runtime.ros1.transport import Publisher, Subscriber
from ros_visualise.runtime.ros1.types import TYPES, message_class
from ros_visualise.runtime.topics import Topic
from ros_visualise.vision.compression import compress, decompress

log = logging.getLogger(__name__)

_SAY_AGAIN_S = 10.0
_PATIENCE_S = 1.0  # with a subscriber that has stopped reading
_LARGE_BYTES = 20_000_000  # of this size the sockets of a connection keep one image at most


class Output:
    """Publishes a topic of this process on the ROS graph.

    Args:
        name: the topic as the node calls it.
        data_class: the type of its messages.
        latched: whoever subscribes gets the last message at once.
    """

    def __init__(self, name: str, data_class: type, latched: bool = False) -> None:
        self._publisher = Publisher(name, message_class(data_class), latch=latched)
        self._latched = latched
        self._refused = 0

    @property
    def name(self) -> str:
        """Its name on the graph."""
        return self._publisher.name

    @property
    def connections(self) -> int:
        """How many subscribers there are."""
        return self._publisher.connections

    @property
    def awaited(self) -> bool:
        """Whether anybody has a use for the next message."""
        return self._latched or self.connections > 0

    @property
    def dropped(self) -> int:
        """Messages that subscribers had no time for, or that ROS cannot hold."""
        return self._publisher.dropped + self._refused

    def put(self, packet: Packet) -> None:
        """Publish a message."""
        if packet.message is not None and self.awaited:
            self._send(self._publisher, packet.message)

    def _send(self, publisher: Publisher, message: Any, header: Header | None = None) -> None:
        """Publish a message, unless ROS cannot hold it, as a stamp before 1970."""
        try:
            publisher.publish(to_message(message, TYPES, header))
        except ValueError as error:
            self._refuse(publisher, error)

    def _refuse(self, publisher: Publisher, error: Exception) -> None:
        if not self._refused:
            log.warning("%s: a message is left out: %s (said once)", publisher.name, error)
        self._refused += 1

    def close(self) -> None:
        """Nothing more comes; what was latched stays."""

    def flush(self, timeout_s: float) -> None:
        """Wait until the last message is on its way to everybody who reads on."""
        self._publisher.flush(timeout_s)

    def wait_for_room(self, timeout_s: float) -> None:
        """Wait until a subscriber, if there are any, could be sent another message."""
        self._publisher.wait_for_room(timeout_s)


class DescriptionOutput(Output):
    """Publishes a robot's description, and sets the parameter of that name.

    ROS 1 looks for it on the parameter server, ROS 2 on a topic.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name, Text, latched=True)

    def put(self, packet: Packet) -> None:
        """Publish a description."""
        if packet.message is None:
            return
        try:
            rospy.set_param(self.name, packet.message.text)
        except OSError as error:
            log.debug("the parameter server does not answer: %s", error)
        super().put(packet)


class ImageOutput(Output):
    """Publishes images with their calibration, and JPEG or PNG of them.

    Args:
        name: the topic as the node calls it.
        resolved: its name on the graph.
        is_camera: an uncalibrated image has an empty calibration beside it, as drivers do it.
        waits: whether to wait, now, until an image is on its way to all.
    """

    def __init__(
        self, name: str, resolved: str, is_camera: bool, waits: Callable[[], bool]
    ) -> None:
        super().__init__(name, Image)
        self._waits = waits
        self._info = Publisher(info_topic(resolved), message_class(CameraInfo))
        self._compressed = Publisher(f"{resolved}/compressed", message_class(CompressedImage))
        self._is_camera = is_camera
        self._to_compress = Inbox(lossless=False)
        threading.Thread(
            target=self._compress_all, name=f"{resolved}/compressed", daemon=True
        ).start()

    @property
    def wants_info(self) -> bool:
        """Whether anybody wants the calibration."""
        return bool(self._info.connections)

    @property
    def awaited(self) -> bool:
        """Whether anybody wants the image, its calibration, or a JPEG of it."""
        return super().awaited or self.wants_info or self._compressed.connections > 0

    def put(self, packet: Packet) -> None:
        """Publish an image."""
        if packet.message is None:
            return
        try:
            image = content(packet.message)
        except DamagedMessage as error:
            log.warning("%s: %s", self.name, error)
            return
        packet = packet._replace(message=image)
        if self._info.connections:
            self._publish_info(image)
        if self.connections:
            super().put(packet)
        if self._compressed.connections:
            self._to_compress.put(packet)
        if self._waits():
            self.flush(_PATIENCE_S)

    def _publish_info(self, image: Image) -> None:
        info = image.camera_info
        if info is None and self._is_camera:
            info = CameraInfo.uncalibrated(image.height, image.width)
        if info is not None:
            self._send(self._info, info, image.header)

    def _compress_all(self) -> None:
        while (packet := self._to_compress.take()) is not None:
            assert isinstance(packet.message, Image)
            try:
                compressed = compress(packet.message)
            except ValueError as error:
                log.warning("%s: %s", self._compressed.name, error)
            else:
                self._send(self._compressed, compressed)


class Input:
    """Feeds a topic of this process with what comes on the ROS graph.

    Args:
        name: the topic as the node calls it.
        data_class: the type of its messages.
        topic: what is fed.
    """

    def __init__(self, name: str, data_class: type, topic: Topic) -> None:
        self.refused = 0
        self._data_class = data_class
        self._topic = topic
        self._number = 0
        self._said_s = -_SAY_AGAIN_S
        self._subscriber = self._subscribe(name)

    def _subscribe(self, name: str) -> Subscriber:
        return Subscriber(name, message_class(self._data_class), self._take)

    def _take(self, message: Any) -> None:
        try:
            data = self._read(message)
        except ValueError as error:
            self.refused += 1
            self._say(str(error))
            return
        self._number += 1
        try:
            self._topic.publish(Packet(self._number, data, time.monotonic_ns()))
        except RosVisualiseError as error:  # a source refuses it
            self.refused += 1
            self._say(str(error))

    def _read(self, message: Any) -> Any:
        return from_message(message, self._data_class)

    def _say(self, what: str) -> None:
        if time.monotonic() - self._said_s >= _SAY_AGAIN_S:
            self._said_s = time.monotonic()
            log.warning("%s: %s", self._subscriber.name, what)

    def close(self) -> None:
        """End it."""
        self._subscriber.close()


class ImageInput(Input):
    """Feeds a topic with images, raw or compressed, and with their calibration when it is wanted.

    A calibration belongs to a camera, not to a moment: an image gets the newest one of its size.

    Args:
        name: the topic as the node calls it.
        resolved: its name on the graph.
        topic: what is fed.
        compressed: subscribe to ``<name>/compressed`` instead.
        wait_for_room: returns when there is time for another image.
    """

    def __init__(
        self,
        name: str,
        resolved: str,
        topic: Topic,
        compressed: bool,
        wait_for_room: Callable[[], None] = lambda: None,
    ) -> None:
        self._compressed = compressed
        self._wait_for_room = wait_for_room
        self._info_name = info_topic(resolved)
        self._info_subscriber: Subscriber | None = None
        self._info: CameraInfo | None = None
        super().__init__(f"{resolved}/compressed" if compressed else name, Image, topic)

    def want_info(self, wanted: bool) -> None:
        """Subscribe to the calibration, or no longer."""
        if wanted and self._info_subscriber is None:
            kind = message_class(CameraInfo)
            self._info_subscriber = Subscriber(self._info_name, kind, self._take_info)
        elif not wanted and self._info_subscriber is not None:
            self._info_subscriber.close()
            self._info_subscriber = self._info = None

    def close(self) -> None:
        """End it."""
        self.want_info(False)
        super().close()

    def _take(self, message: Any) -> None:
        """Feed an image; the next large one is read when there is time for it.

        What has to be left out is then left out where it is published, before it is sent. Small
        ones are read all the same: the sockets would keep many of them, and so grow them old.
        """
        super()._take(message)
        if len(message.data) >= _LARGE_BYTES:
            self._wait_for_room()

    def _subscribe(self, name: str) -> Subscriber:
        kind = CompressedImage if self._compressed else Image
        return Subscriber(name, message_class(kind), self._take)

    def _read(self, message: Any) -> Image:
        if self._compressed:
            image = decompress(from_message(message, CompressedImage))
        else:
            image = from_message(message, Image)
        info = self._info
        if info is None or (info.height, info.width) != (image.height, image.width):
            return image
        return replace(image, camera_info=info)

    def _take_info(self, message: Any) -> None:
        info = from_message(message, CameraInfo)
        self._info = info if info.K.any() else None  # all zero: not calibrated

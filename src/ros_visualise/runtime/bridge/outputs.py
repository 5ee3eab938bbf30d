"""Outputs of a process: messages to the graph, made only for topics with subscribers."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from ros_visualise.core.errors import DamagedMessage, RosVisualiseError
from ros_visualise.core.supervision import attempt, start
from ros_visualise.data import CameraInfo, CompressedImage, Image, Transforms, TransformStamped
from ros_visualise.messages.calibrations import CAMERA_INFO, info_topic
from ros_visualise.messages.recorded import TopicType, content
from ros_visualise.runtime.bridge.aliases import advertise, image_names
from ros_visualise.runtime.middleware import Publisher, Transport
from ros_visualise.runtime.queues import Inbox, Packet
from ros_visualise.runtime.rejections import RejectedMessages
from ros_visualise.vision.compression import compress

_PATIENCE_S = 1.0  # with a subscriber that has stopped reading


class Output:
    """Publishes a topic of this process on the graph.

    Args:
        publisher: of the topic.
        latched: late subscribers get the last message; an attribute, too.
        unthrottled: returns True while the source of this process plays as fast as possible,
            without loss: then a message waits until there is room for it.
    """

    def __init__(
        self,
        publisher: Publisher,
        latched: bool = False,
        unthrottled: Callable[[], bool] = lambda: False,
    ) -> None:
        self._publisher = publisher
        self.latched = latched
        self._unthrottled = unthrottled
        self._rejected = RejectedMessages()

    @property
    def name(self) -> str:
        """Its name on the graph."""
        return self._publisher.name

    @property
    def publishers(self) -> tuple[Publisher, ...]:
        """All its publishers, also of topics beside it."""
        return (self._publisher,)

    @property
    def connections(self) -> int:
        """Number of subscribers."""
        return self._publisher.connections

    @property
    def awaited(self) -> bool:
        """True if the next message has a use."""
        return self.latched or self.connections > 0

    @property
    def dropped(self) -> int:
        """Messages dropped for slow subscribers, or that the transport cannot hold."""
        return self._publisher.dropped + self._rejected.count

    @property
    def refused(self) -> int:
        """Messages that the transport cannot hold."""
        return self._rejected.count

    def put(self, packet: Packet) -> None:
        """Publish a message."""
        if packet.message is None or not self.awaited:
            return
        if self._unthrottled():
            self.wait_for_room(_PATIENCE_S)
        self._send(self._publisher, packet.message)

    def _send(self, publisher: Publisher, message: Any) -> bool:
        """Publish a message; False if the transport cannot hold it."""
        try:
            publisher.publish(message)
        except DamagedMessage as error:
            self._rejected.add(publisher.name, error)
            return False
        return True

    def close(self) -> None:
        """Nothing more comes; a latched message stays."""

    def flush(self, timeout_s: float) -> None:
        """Wait until the last message is sent to all subscribers that read on."""
        self._publisher.flush(timeout_s)

    def wait_for_room(self, timeout_s: float) -> None:
        """Wait until a subscriber, if any, can take another message."""
        self._publisher.wait_for_room(timeout_s)

    def leave(self) -> None:
        """Close the topic."""
        self._publisher.close()


class StaticFrames:
    """The static transforms of all nodes of a process, which are published together.

    A latched topic holds only its last message.
    """

    def __init__(self) -> None:
        self._known: dict[str, TransformStamped] = {}
        self._lock = threading.Lock()

    def publish(self, added: Transforms, publish: Callable[[Transforms], bool]) -> bool:
        """Publish the known transforms and the added ones, which are kept if that succeeds."""
        with self._lock:
            known = self._known | {one.child_frame_id: one for one in added.transforms}
            is_sent = publish(Transforms(tuple(known.values())))
            if is_sent:
                self._known = known
        return is_sent


class StaticTransformsOutput(Output):
    """Publishes the static transforms of one node."""

    def __init__(self, publisher: Publisher, frames: StaticFrames) -> None:
        super().__init__(publisher, latched=True)
        self._frames = frames

    def _send(self, publisher: Publisher, message: Any) -> bool:
        try:
            found = content(message)
        except DamagedMessage as error:
            self._rejected.add(publisher.name, error)
            return False
        return self._frames.publish(found, partial(super()._send, publisher))


class ImageOutput(Output):
    """Publishes images with their calibration, and JPEG or PNG of them.

    Args:
        transport: of the graph.
        name: of the topic, in the node's words.
        resolved: its name on the graph.
        is_camera: publish an empty calibration with uncalibrated images, as drivers do.
        unthrottled: as of `Output`; a camera then waits until an image is sent to all.
        jpeg_quality: in percent.
    """

    def __init__(
        self,
        transport: Transport,
        name: str,
        resolved: str,
        is_camera: bool,
        unthrottled: Callable[[], bool],
        jpeg_quality: int,
    ) -> None:
        self._jpeg_quality = jpeg_quality
        names = [name, *image_names(resolved)[1:]]
        images = advertise(transport, names, TopicType(Image.type_name))
        super().__init__(images, unthrottled=unthrottled)
        self._info = transport.advertise(info_topic(resolved), CAMERA_INFO)
        compressed = [f"{one}/compressed" for one in image_names(resolved)]
        self._compressed = advertise(transport, compressed, TopicType(CompressedImage.type_name))
        self._is_camera = is_camera
        self._to_compress = Inbox(lossless=False)
        start(f"{resolved}/compressed", self._compress_all)

    @property
    def publishers(self) -> tuple[Publisher, ...]:
        """The publishers of images, calibration, and compressed images."""
        return (self._publisher, self._info, self._compressed)

    @property
    def wants_info(self) -> bool:
        """True if the calibration has subscribers."""
        return bool(self._info.connections)

    @property
    def awaited(self) -> bool:
        """True if the image, its calibration or a JPEG of it has subscribers."""
        return super().awaited or self.wants_info or self._compressed.connections > 0

    def put(self, packet: Packet) -> None:
        """Publish an image."""
        if packet.message is None:
            return
        try:
            image = content(packet.message)
        except DamagedMessage as error:
            self._rejected.add(self.name, error)
            return
        if self.wants_info:
            self._publish_info(image)
        if self._unthrottled():
            self._send_all(image)
            return
        if self.connections:
            self._send(self._publisher, image)
        if self._compressed.connections:
            self._to_compress.put(packet._replace(message=image))

    def leave(self) -> None:
        """Close the topics."""
        self._to_compress.close(discard=True)
        super().leave()
        self._info.close()
        self._compressed.close()

    def _send_all(self, image: Image) -> None:
        """Send an image to all subscribers before the next one is taken: none is dropped."""
        there = [one for one in (self._publisher, self._compressed) if one.connections]
        for publisher in () if self._is_camera else there:
            publisher.wait_for_room(_PATIENCE_S)
        if self._publisher in there:
            self._send(self._publisher, image)
        if self._compressed in there:
            self._send_compressed(image)
        for publisher in there if self._is_camera else ():
            publisher.flush(_PATIENCE_S)

    def _publish_info(self, image: Image) -> None:
        info = image.camera_info
        if info is None and self._is_camera:
            info = CameraInfo.uncalibrated(image.height, image.width)
        if info is not None:
            self._send(self._info, replace(info, header=image.header))

    def _compress_all(self) -> None:
        while (packet := self._to_compress.take()) is not None:
            attempt(self._compressed.name, partial(self._send_compressed, packet.message))

    def _send_compressed(self, image: Any) -> None:
        try:
            compressed = compress(image, self._jpeg_quality)
        except (ValueError, RosVisualiseError) as error:
            self._rejected.add(self._compressed.name, error)
        else:
            self._send(self._compressed, compressed)

"""Aliases of image topics: the names that image_transport and rviz expect, beside their own."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from ros_visualise.messages.calibrations import info_topic
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.middleware import Publisher, Transport


def image_names(topic: str) -> tuple[str, ...]:
    """The topics on which an image is published; the last is in the namespace of its calibration.

    image_transport and rviz's Camera display take the calibration from ``camera_info`` in the
    image's own namespace. That of ``/edges`` is ``/edges/camera_info``, as several images share the
    namespace, so ``/edges`` is ``/edges/image`` as well.
    """
    room = info_topic(topic).rpartition("/")[0]
    return (topic, f"{topic}/image") if room == topic else (topic,)


def advertise(transport: Transport, topics: Sequence[str], type: TopicType) -> Publisher:
    """Publish the same messages on several topics; see `Transport.advertise`."""
    made = [transport.advertise(topic, type) for topic in topics]
    return made[0] if len(made) == 1 else _AliasedPublishers(made)


class _AliasedPublishers:
    """Publishers of the same messages, with the name of the first."""

    def __init__(self, publishers: Sequence[Publisher]) -> None:
        self._publishers = publishers

    @property
    def name(self) -> str:
        """The full name of the first topic."""
        return self._publishers[0].name

    @property
    def connections(self) -> int:
        """Number of subscribers, of all names together."""
        return sum(one.connections for one in self._publishers)

    @property
    def dropped(self) -> int:
        """Messages dropped for slow subscribers."""
        return sum(one.dropped for one in self._publishers)

    def publish(self, message: Any) -> None:
        """Send a message to the subscribers of each name."""
        for one in self._awaited():
            one.publish(message)

    def flush(self, timeout_s: float) -> None:
        """Wait until the last message is sent to all subscribers that read on."""
        end_s = time.monotonic() + timeout_s
        for one in self._awaited():
            one.flush(max(end_s - time.monotonic(), 0))

    def wait_for_room(self, timeout_s: float) -> None:
        """Wait until each used name has a subscriber with no message waiting."""
        end_s = time.monotonic() + timeout_s
        for one in self._awaited():
            one.wait_for_room(max(end_s - time.monotonic(), 0))

    def close(self) -> None:
        """Close all of the topics."""
        for one in self._publishers:
            one.close()

    def _awaited(self) -> list[Publisher]:
        return [one for one in self._publishers if one.connections]

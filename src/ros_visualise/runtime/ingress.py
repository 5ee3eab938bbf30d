"""Ingress of messages into a graph: each gets its number and its epoch."""

from __future__ import annotations

import threading
import time
from collections.abc import Collection
from typing import Any, NamedTuple

from ros_visualise.data.poses import is_static, is_transforms
from ros_visualise.runtime.queues import Packet
from ros_visualise.runtime.topics import Topic

_LATE_NS = 1_000_000_000  # messages come late, and publishers of transforms disagree
_SETTLED_NS = 1_000_000_000  # time in which all topics jump
_WILD_NS = 10_000_000_000  # a stamp this far ahead is wild if the next one is not


class _Jump(NamedTuple):
    topic: str
    from_ns: int
    at_ns: int


_NONE = _Jump("", 0, 0)


class Epochs:
    """Counts jumps of time, after which nodes with memory are reset.

    Time jumps where the stamps on a topic go back by more than a second. Topics jump one after the
    other: messages that still come on the others from before the jump belong to the epoch before.
    Messages without a stamp (0), single stamps far ahead of those before and after, topics on which
    two clocks alternate, and static transforms do not count. Other transforms, whose publishers
    disagree, count once all of them have been back for a second.

    Args:
        timeless: other topics that do not count.
    """

    def __init__(self, timeless: Collection[str] = ()) -> None:
        self._epoch = 0
        self._newest_ns: dict[str, int] = {}  # topic -> its newest stamp in this epoch
        self._before_ns: dict[str, int] = {}  # and in the one before
        self._jump = _NONE
        self._leaps_ns: dict[str, int] = {}  # topic -> its stamp before its last, which leapt ahead
        self._back_ns: dict[str, int] = {}  # topic -> since when its stamps have been back
        self._timeless = set(timeless)

    def begin(self) -> None:
        """Time jumps, for all topics at once, as after a seek."""
        self._epoch += 1
        self._newest_ns, self._before_ns, self._jump = {}, {}, _NONE
        self._leaps_ns, self._back_ns = {}, {}

    def of(self, topic: str, stamp_ns: int, now_ns: int) -> int:
        """The epoch of the next message on a topic; ``now_ns`` is a monotonic time."""
        if not stamp_ns:
            return self._epoch
        is_settled = now_ns > self._jump.at_ns + _SETTLED_NS
        if topic == self._jump.topic and stamp_ns >= self._jump.from_ns and not is_settled:
            self._timeless.add(topic)
        if topic in self._timeless or is_static(topic):
            return self._epoch
        newest_ns = self._newest_before(topic, stamp_ns)
        if stamp_ns < newest_ns - _LATE_NS:
            since_ns = self._back_ns.setdefault(topic, now_ns)
            if is_transforms(topic) and now_ns < since_ns + _SETTLED_NS:
                return self._epoch
            before_ns, jump = self._newest_ns, _Jump(topic, newest_ns, now_ns)
            self.begin()
            self._before_ns, self._jump, newest_ns = before_ns, jump, stamp_ns
        elif not is_settled and self._is_from_before(topic, stamp_ns):
            self._before_ns[topic] = max(stamp_ns, self._before_ns[topic])
            return self._epoch - 1
        self._back_ns.pop(topic, None)
        self._newest_ns[topic] = max(stamp_ns, newest_ns)
        return self._epoch

    def _newest_before(self, topic: str, stamp_ns: int) -> int:
        """The newest stamp of a topic, except a single one far ahead."""
        newest_ns, calm_ns = self._newest_ns.get(topic, stamp_ns), self._leaps_ns.pop(topic, None)
        if calm_ns is not None and abs(stamp_ns - calm_ns) < _WILD_NS:
            self._newest_ns[topic] = newest_ns = calm_ns
        elif stamp_ns > newest_ns + _WILD_NS:
            self._leaps_ns[topic] = newest_ns
        return newest_ns

    def _is_from_before(self, topic: str, stamp_ns: int) -> bool:
        """True if a topic goes on as before, though others have jumped back."""
        if topic in self._newest_ns or topic not in self._before_ns:
            return False
        goes_on = stamp_ns >= self._before_ns[topic] - _LATE_NS
        return goes_on and stamp_ns > max(self._newest_ns.values()) + _LATE_NS


class Numbering:
    """Numbers the messages that come in on all topics together, and notices jumps of time."""

    def __init__(self) -> None:
        self._number = 0
        self._epochs = Epochs()
        self._lock = threading.Lock()

    def packet(self, topic: str, message: Any) -> Packet:
        """The packet of the next message."""
        with self._lock:
            self._number += 1
            arrival_ns = time.monotonic_ns()
            epoch = self._epochs.of(topic, message.header.stamp_ns, arrival_ns)
            return Packet(self._number, message, arrival_ns, epoch=epoch)


class Ingress:
    """Publishes the messages that come from outside on one topic, in order, from any thread.

    Args:
        name: of the topic.
        topic: where they are published.
        numbering: shared by all topics from outside.
    """

    def __init__(self, name: str, topic: Topic, numbering: Numbering) -> None:
        self._name, self._topic, self._numbering = name, topic, numbering
        self._turn = threading.Lock()

    def publish(self, message: Any) -> None:
        """Publish a message.

        Raises:
            RosVisualiseError: a source rejects it.
        """
        with self._turn:
            self._topic.publish(self._numbering.packet(self._name, message), raises=True)

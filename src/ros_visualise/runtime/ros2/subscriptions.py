"""Topics of the ROS 2 graph, as our messages."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple

from rclpy.callback_groups import CallbackGroup
from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation

from ros_visualise.core import supervision
from ros_visualise.core.errors import DamagedMessage, UsageError
from ros_visualise.messages import data_class, from_message
from ros_visualise.messages.qos import QoS
from ros_visualise.runtime.ros2 import rcl
from ros_visualise.runtime.ros2.qos_events import SubscriptionEventCallbacks
from ros_visualise.runtime.ros2.quality import (
    fitting,
    overridden,
    profile,
)
from ros_visualise.runtime.ros2.session import Ros2Session, spelled
from ros_visualise.runtime.ros2.types import DEFINITIONS, message_class

_LOOK_S = 0.2
_TOGETHER_S = 0.5
"""For so long a subscription goes on beside the one that takes its place."""
_KEPT = 256
_LEAST = 5
"""Messages of any kind that may wait at least: as of REP 2003's sensor data."""
_LARGE_BYTES = 1_000_000
_NS = 1_000_000_000


class _Asked(NamedTuple):
    """Messages that a subscription asks for, of a type as ``nav2_msgs/msg/ParticleCloud``."""

    type: str
    qos: QoS


class Ros2Subscriber:
    """Calls ``take`` with each message of a topic, on a thread of its own.

    It asks for what all publishers offer: when they change, another subscription replaces it.
    Of large messages that wait only the newest is taken.

    Args:
        session: of this process.
        topic: its name.
        kind: the class of ours that its messages become.
        take, refuse: as of `ros_visualise.runtime.middleware.Middleware.subscribe`.

    Attributes:
        name: the topic's full name on the graph.
        dropped: large messages that were skipped for newer ones.

    Raises:
        UsageError: ROS 2 has no such type, or the name is invalid.
    """

    def __init__(
        self,
        session: Ros2Session,
        topic: str,
        kind: Any,
        take: Callable[[Any], None],
        refuse: Callable[[str], None],
    ) -> None:
        self.name = session.resolve(topic)
        self.dropped = 0
        self._session, self._topic, self._kind = session, topic, kind
        self._take, self._refuse = take, refuse
        self._taker = rcl.Taker()
        self._sent_ns: deque[int] = deque(maxlen=_KEPT)
        self._closed = threading.Event()
        self._wake = GuardCondition(None, None, session.context)
        self._asked = self._wanted(_Asked(kind.type_name, QoS(max(kind.waiting, _LEAST))))
        self._refused: _Asked | None = None
        self._open = [self._subscribe(self._asked)]
        self._changed_s = time.monotonic()
        self._known: frozenset[int] = frozenset()
        self._looked_s = time.monotonic()
        session.start(self.name, self._run, again_s=_LOOK_S)

    def close(self) -> None:
        """Leave the topic."""
        self._closed.set()
        with suppress(rclpy_implementation.InvalidHandle):  # it has ended meanwhile
            self._wake.trigger()

    def _run(self) -> None:
        while not (self._closed.is_set() or self._session.is_over):
            self._wait()
            for one in self._open:
                self._take_all(one)
            if time.monotonic() - self._looked_s >= _LOOK_S:
                self._looked_s = time.monotonic()
                self._adapt()
        while self._open:
            self._session.node.destroy_subscription(self._open.pop())
        self._wake.destroy()

    def _wait(self) -> None:
        """Wait until there is a message, or it is time to look at the publishers."""
        count = len(self._open)
        waiting = rclpy_implementation.WaitSet(count, 1, 0, 0, 0, 0, self._session.context.handle)
        waiting.clear_entities()
        for one in self._open:
            waiting.add_subscription(one.handle)
        waiting.add_guard_condition(self._wake.handle)
        waiting.wait(int(_LOOK_S * _NS))

    def _take_all(self, subscription: Any) -> None:
        taken = self._taker.take(subscription)
        while taken is not None and not self._closed.is_set():
            newer = self._taker.take(subscription)
            if not self._came_before(taken.sent_ns):
                if newer is not None and taken.data.nbytes >= _LARGE_BYTES:
                    self.dropped += 1
                else:
                    supervision.attempt(self.name, partial(self._hand_on, taken.data))
            taken = newer

    def _came_before(self, sent_ns: int) -> bool:
        """True if the other subscription had it: publishers keep some for those who come late."""
        both = len(self._open) > 1
        came = sent_ns in self._known or (both and sent_ns in self._sent_ns)
        self._sent_ns.append(sent_ns)
        return came

    def _hand_on(self, data: Any) -> None:
        try:
            message = DEFINITIONS.read(self._asked.type, data.data)
            found: Any = from_message(message, self._kind)
        except (DamagedMessage, ValueError) as error:
            self._refuse(str(error))
        else:
            self._take(found)

    def _adapt(self) -> None:
        """Ask for something else as soon as the publishers offer something else."""
        now_s = time.monotonic()
        if len(self._open) > 1 and now_s - self._changed_s > _TOGETHER_S:
            self._session.node.destroy_subscription(self._open.pop(0))
        elif self._known and now_s - self._changed_s > 2 * _TOGETHER_S:
            self._known = frozenset()
        wanted = self._wanted(self._asked)
        if wanted != self._asked and len(self._open) == 1:
            self._turn_to(wanted, now_s)

    def _turn_to(self, wanted: _Asked, now_s: float) -> None:
        if wanted == self._refused:
            return
        try:
            opened = self._subscribe(wanted)
        except UsageError as error:
            self._refused = wanted
            self._refuse(str(error))
            return
        if wanted.type != self._asked.type:  # nothing comes any more of what was asked for
            self._session.node.destroy_subscription(self._open.pop())
        self._asked, self._refused, self._changed_s = wanted, None, now_s
        self._known = frozenset(self._sent_ns)
        self._open.append(opened)

    def _wanted(self, asked: _Asked) -> _Asked:
        """The QoS that all publishers offer; without any, one that all will fit."""
        there = [
            one
            for one in self._session.node.get_publishers_info_by_topic(self.name)
            if data_class(one.topic_type) is self._kind
        ]
        if not there:
            return asked._replace(qos=QoS(asked.qos.depth, reliable=False))
        qos = fitting([one.qos_profile for one in there], asked.qos.depth)
        return _Asked(there[0].topic_type, qos)

    def _subscribe(self, asked: _Asked) -> Any:
        node = self._session.node
        with overridden(node, self.name, "subscription") as overrides:
            return node.create_subscription(
                message_class(asked.type),
                spelled(self._topic),
                _is_taken_here,
                profile(asked.qos),
                callback_group=_Apart(),
                event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
                qos_overriding_options=overrides,
                raw=True,
            )


class _Apart(CallbackGroup):  # type: ignore[misc]
    """Keeps rclpy's executor from taking messages, which the subscriber's own thread takes."""

    def can_execute(self, entity: Any) -> bool:
        return False

    def beginning_execution(self, entity: Any) -> bool:
        return False

    def ending_execution(self, entity: Any) -> None:
        """It has not begun."""


def _is_taken_here(_: Any) -> None:
    raise AssertionError("the executor has no message to take")

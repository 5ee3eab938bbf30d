"""Topics that browsers ask for by question and answer: subscribed to while they ask."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.topics import Subscription

_IDLE_S = 5.0
_STEP_S = 0.02
_KEPT_BYTES = 192 << 20
"""Of the messages of one topic that are kept, the newest one apart."""


class Tap:
    """The last messages of one topic; it may be called from any thread."""

    def __init__(self, subscription: Subscription, depth: int, now_s: float) -> None:
        self._subscription = subscription
        self._kept: deque[Any] = deque(maxlen=depth)
        self._lock = threading.Lock()
        self.used_s = now_s

    def messages(self) -> list[Any]:
        """Those that are there, the newest last."""
        with self._lock:
            while (message := self._subscription.take(0)) is not None:
                self._kept.append(message)
            while len(self._kept) > 1 and sum(map(_size, self._kept)) > _KEPT_BYTES:
                self._kept.popleft()
            return list(self._kept)

    def close(self) -> None:
        """Ask for no more."""
        self._subscription.close()


class Taps:
    """The topics that were asked for lately.

    Args:
        runtime: what runs.
        depth: how many messages of each are kept.
        clock: seconds.
    """

    def __init__(
        self, runtime: Runtime, depth: int, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._runtime, self._depth, self._clock = runtime, depth, clock
        self._taps: dict[str, Tap] = {}
        self._lock = threading.Lock()

    def newest(self, topic: str, wait_s: float = 0.0) -> Any:
        """The newest message; None if none comes in time."""
        return next(reversed(self._wait(topic, bool, wait_s)), None)

    def at(self, topic: str, stamp_ns: int, wait_s: float = 0.0) -> Any:
        """The message of this stamp; None if a later one is there, or none comes in time."""
        messages = self._wait(
            topic, lambda there: any(_stamp_ns(one) >= stamp_ns for one in there), wait_s
        )
        return next((one for one in messages if _stamp_ns(one) == stamp_ns), None)

    def near(self, topic: str, stamp_ns: int) -> Any:
        """The message of the nearest stamp; None if none is there."""
        messages = self._tap(topic).messages()
        return min(messages, key=lambda one: abs(_stamp_ns(one) - stamp_ns), default=None)

    def rest(self, all_of_them: bool = False) -> None:
        """Let go of those that nobody asked for lately."""
        with self._lock:
            for topic, tap in list(self._taps.items()):
                if all_of_them or self._clock() - tap.used_s > _IDLE_S:
                    self._taps.pop(topic).close()

    def _wait(self, topic: str, until: Callable[[list[Any]], bool], wait_s: float) -> list[Any]:
        """What is there of a topic, as soon as that will do, or when the time is over."""
        end_s = self._clock() + wait_s
        while not until(messages := self._tap(topic).messages()) and self._clock() < end_s:
            time.sleep(_STEP_S)
        return messages

    def _tap(self, topic: str) -> Tap:
        with self._lock:
            if topic not in self._taps:
                subscription = self._runtime.subscribe(topic, self._depth)
                self._taps[topic] = Tap(subscription, self._depth, self._clock())
            self._taps[topic].used_s = self._clock()
            return self._taps[topic]


def _size(message: Any) -> int:
    return int(getattr(getattr(message, "data", None), "nbytes", 0))


def _stamp_ns(message: Any) -> int:
    return int(message.header.stamp_ns)

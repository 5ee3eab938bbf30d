"""Topics that browsers query: subscribed to while they do."""

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
"""Maximum bytes of one topic's kept messages, beside the newest one."""


class Tap:
    """The last messages of one topic; safe to call from any thread."""

    def __init__(self, subscription: Subscription, depth: int, now_s: float) -> None:
        self._subscription = subscription
        self._kept: deque[Any] = deque(maxlen=depth)
        self._lock = threading.Lock()
        self.used_s = now_s

    def messages(self) -> list[Any]:
        """The kept messages, the newest last."""
        with self._lock:
            while (message := self._subscription.take(0)) is not None:
                self._kept.append(message)
            while len(self._kept) > 1 and sum(map(_size, self._kept)) > _KEPT_BYTES:
                self._kept.popleft()
            return list(self._kept)

    def close(self) -> None:
        self._subscription.close()


class Taps:
    """The topics with recent queries; of each, ``depth`` messages are kept."""

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
        with self._lock:
            for topic, tap in list(self._taps.items()):
                if all_of_them or self._clock() - tap.used_s > _IDLE_S:
                    self._taps.pop(topic).close()

    def _wait(self, topic: str, until: Callable[[list[Any]], bool], wait_s: float) -> list[Any]:
        """The messages of a topic, as soon as ``until`` holds or the time is over."""
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

"""Topics whose newest message was asked for lately: subscribed to for some seconds."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.topics import Subscription

_IDLE_S = 5.0
_STEP_S = 0.02


class _Tap:
    """The newest message of one topic."""

    def __init__(self, subscription: Subscription, now_s: float) -> None:
        self._subscription, self._newest = subscription, None
        self.used_s = now_s

    def newest(self) -> Any:
        while (message := self._subscription.take(0, decode=False)) is not None:
            self._newest = message
        return self._newest

    def close(self) -> None:
        self._subscription.close()


class Taps:
    """Gives the newest messages of topics; safe to call from any thread."""

    def __init__(self, runtime: Runtime, clock: Callable[[], float] = time.monotonic) -> None:
        self._runtime, self._clock = runtime, clock
        self._taps: dict[str, _Tap] = {}
        self._lock = threading.Lock()

    def newest(self, topic: str, wait_s: float = 0.0) -> Any:
        """The newest message, not decoded; None if none comes in time."""
        end_s = self._clock() + wait_s
        while (message := self._look(topic)) is None and self._clock() < end_s:
            time.sleep(_STEP_S)
        return message

    def rest(self, all_of_them: bool = False) -> None:
        """Unsubscribe from topics without recent questions."""
        with self._lock:
            for topic, tap in list(self._taps.items()):
                if all_of_them or self._clock() - tap.used_s > _IDLE_S:
                    self._taps.pop(topic).close()

    def _look(self, topic: str) -> Any:
        with self._lock:
            if topic not in self._taps:
                self._taps[topic] = _Tap(self._runtime.subscribe(topic), self._clock())
            self._taps[topic].used_s = self._clock()
            return self._taps[topic].newest()

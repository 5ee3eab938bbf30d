"""A subscription to a chosen topic."""

from __future__ import annotations

from typing import Any

from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.topics import Subscription


class Feed:
    """The messages of the chosen topic; up to ``depth`` wait; with 1, always the newest."""

    def __init__(self, runtime: Runtime, depth: int = 1) -> None:
        self._runtime, self._depth = runtime, depth
        self._topic: str | None = None
        self._subscription: Subscription | None = None

    def follow(self, topic: str | None) -> bool:
        """Subscribe to this topic, or to none; True if that is a change."""
        if topic == self._topic:
            return False
        if self._subscription is not None:
            self._subscription.close()
        self._subscription = None if topic is None else self._runtime.subscribe(topic, self._depth)
        self._topic = topic
        return True

    @property
    def epoch(self) -> int:
        """Number of time jumps before the message taken last."""
        return 0 if self._subscription is None else self._subscription.epoch

    def take(self, decode: bool = True) -> Any:
        """The oldest waiting message, or None; see `Subscription.take`."""
        return None if self._subscription is None else self._subscription.take(0, decode)

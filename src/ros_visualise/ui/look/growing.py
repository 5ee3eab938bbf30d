"""Curves that grow as messages come."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.feed import Feed
from ros_visualise.ui.look.curve import Curve
from ros_visualise.ui.look.trees import fields_of

_WAITING = 2000  # messages of a topic between two questions
_IDLE_S = 20.0
_NS = 1e-9

Name = tuple[str, str]


class Growing:
    """Adds what comes on topics to curves, whenever it is asked to.

    The time of a message is where playing is now, less the difference of its stamp to the newest
    one; where nothing is played, it counts from the first stamp.

    Attributes:
        now_s: the time of the newest message.
    """

    def __init__(self, runtime: Runtime, clock: Callable[[], float] = time.monotonic) -> None:
        self._runtime, self._clock = runtime, clock
        self._curves: dict[Name, Curve] = {}
        self._feeds: dict[str, Feed] = {}
        self._used_s = 0.0
        self._first_ns: int | None = None
        self._lock = threading.Lock()
        self.now_s = 0.0

    def add(self, name: Name, curve: Curve) -> None:
        """Let a curve grow from now on."""
        with self._lock:
            self._curves[name] = curve
            if name[0] not in self._feeds:
                self._feeds[name[0]] = Feed(self._runtime, _WAITING)
                self._feeds[name[0]].follow(name[0])

    def keep(self, names: set[Name]) -> None:
        """These are asked for at the moment."""
        if names:
            self._used_s = self._clock()

    def take(self) -> None:
        """Add what has come since."""
        with self._lock:
            for topic, feed in self._feeds.items():
                messages = []
                while (message := feed.take()) is not None:
                    messages.append(message)
                self._add(topic, messages)

    def rest(self, all_of_them: bool) -> list[Name]:
        """Ask for nothing more where nobody asked lately; the curves that end by that."""
        with self._lock:
            if not self._curves or (not all_of_them and self._clock() - self._used_s < _IDLE_S):
                return []
            for feed in self._feeds.values():
                feed.follow(None)
            ended = list(self._curves)
            self._curves, self._feeds = {}, {}
            return ended

    def _add(self, topic: str, messages: list[Any]) -> None:
        if not messages:
            return
        stamps_ns = [message.header.stamp_ns for message in messages]
        newest_ns = max(stamps_ns)
        if self._first_ns is None:
            self._first_ns = min(stamps_ns)
        now_s = self._now_s(newest_ns - self._first_ns)
        for message in messages:
            fields = fields_of(message)
            time_s = max(now_s - (newest_ns - message.header.stamp_ns) * _NS, 0.0)
            for (name, path), curve in self._curves.items():
                if name == topic and path in fields:
                    curve.add(time_s, fields[path])

    def _now_s(self, passed_ns: int) -> float:
        playback = self._runtime.playback
        if playback is not None:
            return playback.state.position_s
        self.now_s = max(passed_ns, 0) * _NS
        return self.now_s

"""Numeric fields over time: read from a recording, or growing as messages arrive."""

from __future__ import annotations

import logging
import threading
import time
from array import array
from bisect import bisect_left
from collections.abc import Callable, Collection, Mapping
from concurrent.futures import Future
from contextlib import closing
from queue import SimpleQueue
from typing import Any

import numpy as np

from ros_visualise.core import supervision
from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.data import Floats
from ros_visualise.geometry.thinning import extremes
from ros_visualise.runtime.base import Runtime
from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.recordings.playing import played_time
from ros_visualise.ui.feed import Feed
from ros_visualise.ui.look.trees import fields_of

log = logging.getLogger(__name__)

_MAX_POINTS = 5_000_000
_NS = 1e-9
_NAME = "curves"
_BATCH = 50  # messages read between two pauses for other threads
_PAUSE_S = 0.001
_UNREADABLE = (RosVisualiseError, ValueError, OSError)
_QUEUED = 2000  # messages of a topic between two requests
_IDLE_S = 20.0

Name = tuple[str, str]
"""A topic and the path of a field."""


class Curve:
    """Values in order of time; thread-safe.

    Attributes:
        share: share that is loaded, 0 to 1; None: it grows as messages arrive.
        error: why it ends early; empty if it does not.
    """

    def __init__(self, share: float | None) -> None:
        self.share = share
        self.error = ""
        self._times_s, self._values = array("d"), array("d")
        self._lock = threading.Lock()

    def add(self, time_s: float, value: float) -> None:
        """Append a value; where time jumps back, later values are removed."""
        with self._lock:
            if self._times_s and time_s < self._times_s[-1]:
                kept = bisect_left(self._times_s, time_s)
                del self._times_s[kept:], self._values[kept:]
            if len(self._times_s) < _MAX_POINTS:
                self._times_s.append(time_s)
                self._values.append(value)

    def between(self, start_s: float, end_s: float, points: int) -> tuple[Floats, Floats]:
        """Times and values from one time to another, with one more on either side.

        Args:
            start_s, end_s: seconds.
            points: maximum number; of each stretch the lowest and the highest value are kept.
        """
        with self._lock:
            times_s, values = np.array(self._times_s), np.array(self._values)
        first = max(int(np.searchsorted(times_s, start_s)) - 1, 0)
        last = int(np.searchsorted(times_s, end_s, "right")) + 1
        chosen = first + extremes(values[first:last], points)
        return times_s[chosen], values[chosen]


class RecordedCurves:
    """Fills curves from the topics of a recording, one topic after another, in its own thread.

    Args:
        open_it: opens the recording; one thread at a time can read a recording.
        played: the topics that are played: gaps of their time are skipped; None: the stamps are the
            times of playback.
    """

    def __init__(self, open_it: Callable[[], Recording], played: Collection[str] | None) -> None:
        self._open, self._played = open_it, played
        self._jobs: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._recording: Recording | None = None
        self._closed = False
        self._starting = threading.Lock()
        self._thread: threading.Thread | None = None

    def fill(self, topic: str, curves: Mapping[str, Curve]) -> None:
        """Fill these curves, by the paths of their fields, after those requested before."""
        self._enqueue(lambda: self._try_fill(topic, curves))

    def first(self, topic: str, wait_s: float) -> Any:
        """The first message of a topic; None without any in time."""
        found: Future[Any] = Future()
        self._enqueue(lambda: found.set_result(self._first(topic)))
        try:
            return found.result(wait_s)
        except TimeoutError:
            return None

    def close(self) -> None:
        """End after the present message."""
        self._closed = True
        self._jobs.put(None)

    def _enqueue(self, job: Callable[[], None]) -> None:
        self._jobs.put(job)
        with self._starting:
            self._thread = self._thread or supervision.start(_NAME, self._run)

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None:
            supervision.attempt(_NAME, job)
        if self._recording is not None:
            self._recording.close()

    def _opened(self) -> Recording:
        self._recording = self._recording or self._open()
        return self._recording

    def _first(self, topic: str) -> Any:
        try:
            with closing(self._opened().read(topics=[topic])) as entries:
                return next((entry.message for entry in entries), None)
        except _UNREADABLE:
            return None
        except supervision.ERRORS as error:
            supervision.note(_NAME, error)
            return None

    def _try_fill(self, topic: str, curves: Mapping[str, Curve]) -> None:
        try:
            self._fill(self._opened(), topic, curves)
        except supervision.ERRORS as error:
            if isinstance(error, _UNREADABLE):
                log.warning("cannot plot %s: %s", topic, error)
            else:
                supervision.note(_NAME, error)
            for curve in curves.values():
                curve.error = str(error) or type(error).__name__
        for curve in curves.values():
            curve.share = 1.0

    def _fill(self, recording: Recording, topic: str, curves: Mapping[str, Curve]) -> None:
        place_ns: Callable[[int], int] = lambda stamp_ns: max(stamp_ns, 0)  # noqa: E731
        if self._played is not None:
            place_ns = played_time(recording, self._played).place_ns
        total = max(recording.topics[topic].messages, 1)
        with closing(recording.read(topics=[topic])) as entries:
            for number, entry in enumerate(entries):
                if self._closed:
                    return
                _add(curves, place_ns(entry.stamp_ns) * _NS, entry.message)
                if number % _BATCH == 0:
                    time.sleep(_PAUSE_S)
                    for curve in curves.values():
                        curve.share = min(number / total, 0.99)


class LiveCurves:
    """Appends the messages of topics to curves, whenever `take` is called.

    The time of a message is the playback position, minus the difference of its stamp to the newest
    one; without playback, it counts from the first stamp.

    Attributes:
        now_s: time of the newest message.
    """

    def __init__(self, runtime: Runtime, clock: Callable[[], float] = time.monotonic) -> None:
        self._runtime, self._clock = runtime, clock
        self._curves: dict[str, dict[str, Curve]] = {}
        self._feeds: dict[str, Feed] = {}
        self._used_s = 0.0
        self._first_ns: int | None = None
        self._lock = threading.Lock()
        self.now_s = 0.0

    def add(self, topic: str, curves: Mapping[str, Curve]) -> None:
        """Let these curves, by the paths of their fields, grow from now on."""
        with self._lock:
            self._curves.setdefault(topic, {}).update(curves)
            if topic not in self._feeds:
                self._feeds[topic] = Feed(self._runtime, _QUEUED)
                self._feeds[topic].follow(topic)

    def keep(self) -> None:
        """Note that some of them are in use."""
        self._used_s = self._clock()

    def take(self) -> None:
        """Append what has arrived since."""
        with self._lock:
            for topic, feed in self._feeds.items():
                if messages := list(iter(feed.take, None)):
                    self._append(self._curves[topic], messages)

    def rest(self, all_of_them: bool) -> list[Name]:
        """Unsubscribe if no curve was requested lately; the names of the curves that end."""
        with self._lock:
            if not self._curves or (not all_of_them and self._clock() - self._used_s < _IDLE_S):
                return []
            for feed in self._feeds.values():
                feed.follow(None)
            ended = [(topic, path) for topic, curves in self._curves.items() for path in curves]
            self._curves, self._feeds = {}, {}
            return ended

    def _append(self, curves: Mapping[str, Curve], messages: list[Any]) -> None:
        stamps_ns = [message.header.stamp_ns for message in messages]
        newest_ns = max(stamps_ns)
        if self._first_ns is None:
            self._first_ns = min(stamps_ns)
        now_s = self._now_s(newest_ns - self._first_ns)
        for message, stamp_ns in zip(messages, stamps_ns, strict=True):
            _add(curves, max(now_s - (newest_ns - stamp_ns) * _NS, 0.0), message)

    def _now_s(self, passed_ns: int) -> float:
        playback = self._runtime.playback
        if playback is not None:
            return playback.state.position_s
        self.now_s = max(passed_ns, 0) * _NS
        return self.now_s


def _add(curves: Mapping[str, Curve], time_s: float, message: Any) -> None:
    fields = fields_of(message)
    for path, curve in curves.items():
        if path in fields:
            curve.add(time_s, fields[path])

"""Fills stores of curves: from a recording, or as messages arrive.

The path of a store may be empty: that number is 1 for each message, for its time alone.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Collection
from concurrent.futures import Future
from concurrent.futures import TimeoutError as TimedOut
from contextlib import closing
from queue import SimpleQueue
from typing import Any

import numpy as np

from ros_visualise.core import supervision
from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.messages.numeric_fields import number_at
from ros_visualise.messages.recorded import as_ros
from ros_visualise.runtime.base import Runtime
from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.recordings.playing import played_time
from ros_visualise.ui.feed import Feed
from ros_visualise.ui.live.curves import SampleStore, StoreFull
from ros_visualise.ui.live.played import playback_line

log = logging.getLogger(__name__)

_NS = 1e9
_NAME = "curves"
_BATCH = 50  # messages read between two pauses for other threads
_PAUSE_S = 0.001
_UNREADABLE = (RosVisualiseError, ValueError, OSError)
_QUEUED = 2000  # messages of a topic between two calls of `take`
_IDLE_S = 600.0
_OTHER_CLOCK_NS = 60 * 1_000_000_000
"""Stamps this far outside of a recording are of another clock."""


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

    def fill(self, topic: str, store: SampleStore) -> None:
        """Fill a store, after those requested before."""
        self._enqueue(lambda: self._try_fill(topic, store))

    def first(self, topic: str, wait_s: float) -> Any:
        """The first message of a topic; None without any in time."""
        found: Future[Any] = Future()
        self._enqueue(lambda: found.set_result(self._first(topic)))
        try:
            return found.result(wait_s)
        except TimedOut:
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

    def _try_fill(self, topic: str, store: SampleStore) -> None:
        try:
            self._fill(self._opened(), topic, store)
        except StoreFull:
            store.error = f"only the first {len(store)} messages fit into memory"
        except supervision.ERRORS as error:
            if isinstance(error, _UNREADABLE):
                log.warning("cannot plot %s: %s", topic, error)
            else:
                supervision.note(_NAME, error)
            store.error = str(error) or type(error).__name__
        store.share = 1.0

    def _fill(self, recording: Recording, topic: str, store: SampleStore) -> None:
        place_ns = self._places(recording)
        total = max(recording.topics[topic].messages, 1)
        samples = _NewSamples(store)
        with closing(recording.read(topics=[topic])) as entries:
            for number, entry in enumerate(entries):
                if self._closed:
                    return
                samples.add(place_ns(entry.stamp_ns, entry.message) / _NS, entry.message)
                if number % _BATCH == 0:
                    samples.flush()
                    time.sleep(_PAUSE_S)
                    store.share = min(number / total, 0.99)
        samples.flush()

    def _places(self, recording: Recording) -> Callable[[int, Any], int]:
        """The place of a message on the line of playback, by its stamp if that is of this clock."""
        if self._played is None:
            return lambda stamp_ns, _: max(stamp_ns, 0)
        line = played_time(recording, self._played)
        start_ns, end_ns = recording.start_ns - _OTHER_CLOCK_NS, recording.end_ns + _OTHER_CLOCK_NS

        def place_ns(stamp_ns: int, message: Any) -> int:
            own_ns = message.header.stamp_ns
            return line.place_ns(own_ns if start_ns <= own_ns <= end_ns else stamp_ns)

        return place_ns


class _NewSamples:
    """Collects samples for a store."""

    def __init__(self, store: SampleStore) -> None:
        self._store = store
        self._times_s: list[float] = []
        self._rows: list[list[float]] = []

    def add(self, time_s: float, message: Any) -> None:
        found = as_ros(message)
        self._times_s.append(time_s)
        self._rows.append([number_at(path, found) if path else 1.0 for path in self._store.paths])

    def flush(self) -> None:
        if self._rows:
            self._store.add(np.array(self._times_s), np.array(self._rows, np.float64))
            self._times_s, self._rows = [], []


class _LiveTopic:
    """A topic that is followed, and the stores that grow by it."""

    def __init__(self, feed: Feed) -> None:
        self.feed, self.epoch = feed, 0
        self.stores: list[SampleStore] = []


class LiveCurves:
    """Appends the messages of topics to stores, whenever `take` is called.

    The time of a message is that of its stamp: on the line of playback; without one, or if the
    source is live, it counts from the first stamp. Where time jumps back, later values are removed.

    Attributes:
        now_s: time of the newest message.
    """

    def __init__(self, runtime: Runtime, clock: Callable[[], float] = time.monotonic) -> None:
        self._runtime, self._clock = runtime, clock
        self._topics: dict[str, _LiveTopic] = {}
        self._used_s = 0.0
        self._first_ns: int | None = None
        self._lock = threading.Lock()
        self.now_s = 0.0

    @property
    def is_played(self) -> bool:
        """True if times are those of a playback."""
        return not self._runtime.graph.live and self._runtime.playback is not None

    def add(self, topic: str, store: SampleStore) -> None:
        """Let a store grow from now on."""
        with self._lock:
            if topic not in self._topics:
                self._topics[topic] = _LiveTopic(Feed(self._runtime, _QUEUED))
            self._topics[topic].stores.append(store)
            self._topics[topic].feed.follow(topic)

    def keep(self) -> None:
        """Note that some of them are in use; those that rested go on after a gap."""
        with self._lock:
            self._used_s = self._clock()
            for topic, live in self._topics.items():
                if live.feed.follow(topic):
                    for store in live.stores:
                        store.break_line()

    def take(self) -> None:
        """Append what has arrived since."""
        with self._lock:
            for live in self._topics.values():
                self._append(live)

    def rest(self, all_of_them: bool) -> None:
        """Unsubscribe if no curve was requested for ten minutes; their samples are kept."""
        with self._lock:
            if all_of_them or self._clock() - self._used_s >= _IDLE_S:
                for live in self._topics.values():
                    live.feed.follow(None)

    def forget(self, topic: str, store: SampleStore) -> None:
        """Let a store grow no more."""
        with self._lock:
            live = self._topics.get(topic)
            if live is not None and store in live.stores:
                live.stores.remove(store)
                if not live.stores:
                    self._topics.pop(topic).feed.follow(None)

    def _append(self, live: _LiveTopic) -> None:
        samples = [_NewSamples(store) for store in live.stores]
        while (message := live.feed.take()) is not None:
            time_s = self._time_s(message.header.stamp_ns)
            if live.feed.epoch != live.epoch:
                live.epoch = live.feed.epoch
                for one, store in zip(samples, live.stores, strict=True):
                    one.flush()
                    store.cut(time_s)
                    store.break_line()
                self.now_s = time_s
            self.now_s = max(self.now_s, time_s)
            for one in samples:
                one.add(time_s, message)
        for one in samples:
            one.flush()

    def _time_s(self, stamp_ns: int) -> float:
        line = playback_line(self._runtime.graph, self._runtime.playback)
        if line is None:
            if self._first_ns is None or stamp_ns < self._first_ns - _OTHER_CLOCK_NS:
                self._first_ns = stamp_ns
            return (stamp_ns - self._first_ns) / _NS
        range_ns = line.range_ns
        if range_ns is not None:
            start_ns, end_ns = range_ns
            if not start_ns - _OTHER_CLOCK_NS <= stamp_ns <= end_ns + _OTHER_CLOCK_NS:
                return line.playback.time_ns() / _NS
        return max(line.place_ns(stamp_ns), 0) / _NS

    @property
    def origin_s(self) -> float:
        """The stamp from which times of a live source count, seconds."""
        return (self._first_ns or 0) / _NS

    def stamp_ns(self, time_s: float) -> int:
        """The stamp of a time of these curves."""
        line = playback_line(self._runtime.graph, self._runtime.playback)
        place_ns = round(time_s * _NS)
        return place_ns + (self._first_ns or 0) if line is None else line.time_ns(place_ns)

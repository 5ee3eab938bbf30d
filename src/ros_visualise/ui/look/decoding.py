"""Reading a recording through for some numbers, beside what is played of it."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Collection, Mapping
from concurrent.futures import Future
from contextlib import closing
from queue import SimpleQueue
from typing import Any

from ros_visualise.core import supervision
from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.recordings.playing import played_time
from ros_visualise.ui.look.curve import Curve
from ros_visualise.ui.look.trees import fields_of

log = logging.getLogger(__name__)

_NAME = "curves"
_NS = 1e-9
_TURN = 50  # messages, after which others have theirs
_REST_S = 0.001
_UNREADABLE = (RosVisualiseError, ValueError, OSError)


class Decoding:
    """Fills curves from the topics of a recording, one topic after another.

    It opens the recording itself: one thread at a time reads one.

    Args:
        open_it: opens the recording.
        played: the topics that are played: the gaps of their time are skipped; None: its stamps are
            the times of playing.
    """

    def __init__(self, open_it: Callable[[], Recording], played: Collection[str] | None) -> None:
        self._open, self._played = open_it, played
        self._asked: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._recording: Recording | None = None
        self._closed = False
        self._starting = threading.Lock()
        self._thread: threading.Thread | None = None

    def fill(self, topic: str, curves: Mapping[str, Curve]) -> None:
        """Fill these curves, by the paths of their fields, as soon as their turn comes."""
        self._ask(lambda: self._fill_all(topic, curves))

    def first(self, topic: str, wait_s: float) -> Any:
        """The first message of a topic; None if there is none, or not in time."""
        found: Future[Any] = Future()
        self._ask(lambda: found.set_result(self._first(topic)))
        try:
            return found.result(wait_s)
        except TimeoutError:
            return None

    def close(self) -> None:
        """End after the present message."""
        self._closed = True
        self._asked.put(None)

    def _ask(self, job: Callable[[], None]) -> None:
        self._asked.put(job)
        with self._starting:
            self._thread = self._thread or supervision.start(_NAME, self._run)

    def _run(self) -> None:
        while (job := self._asked.get()) is not None:
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

    def _fill_all(self, topic: str, curves: Mapping[str, Curve]) -> None:
        try:
            self._fill(self._opened(), topic, curves)
        except supervision.ERRORS as error:
            if isinstance(error, _UNREADABLE):
                log.warning("%s cannot be drawn: %s", topic, error)
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
                fields = fields_of(entry.message)
                time_s = place_ns(entry.stamp_ns) * _NS
                for path, curve in curves.items():
                    if path in fields:
                        curve.add(time_s, fields[path])
                if number % _TURN == 0:
                    time.sleep(_REST_S)
                    for curve in curves.values():
                        curve.share = min(number / total, 0.99)

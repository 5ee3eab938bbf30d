"""Reading a recording through for some numbers, beside what is played of it."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from queue import SimpleQueue

from ros_visualise.errors import RosVisualiseError
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.recordings.gaps import played_time
from ros_visualise.ui.look.curve import Curve
from ros_visualise.ui.look.trees import fields_of

log = logging.getLogger(__name__)

_NS = 1e-9
_TURN = 50  # messages, after which others have theirs
_REST_S = 0.001


class Decoding:
    """Fills curves from the topics of a recording, one topic after another.

    It opens the recording itself: one thread at a time reads one.

    Args:
        path: the recording.
        played: the topics that are played: the gaps of their time are skipped.
    """

    def __init__(self, path: Path, played: list[str]) -> None:
        self._path, self._played = path, played
        self._asked: SimpleQueue[tuple[str, Mapping[str, Curve]] | None] = SimpleQueue()
        self._closed = False
        self._thread = threading.Thread(target=self._run, name="curves", daemon=True)

    def fill(self, topic: str, curves: Mapping[str, Curve]) -> None:
        """Fill these curves, by the paths of their fields, as soon as their turn comes."""
        if self._thread.ident is None:
            self._thread.start()
        self._asked.put((topic, curves))

    def close(self) -> None:
        """End after the present message."""
        self._closed = True
        self._asked.put(None)

    def _run(self) -> None:
        recording: Recording | None = None
        while (asked := self._asked.get()) is not None:
            topic, curves = asked
            try:
                recording = recording or open_recording(self._path)
                self._fill(recording, topic, curves)
            except (RosVisualiseError, ValueError, OSError) as error:
                log.warning("%s: %s cannot be drawn: %s", self._path, topic, error)
                for curve in curves.values():
                    curve.error = str(error)
            for curve in curves.values():
                curve.share = 1.0
        if recording is not None:
            recording.close()

    def _fill(self, recording: Recording, topic: str, curves: Mapping[str, Curve]) -> None:
        line = played_time(recording, self._played)
        total = max(recording.topics[topic].messages, 1)
        with closing(recording.read(topics=[topic])) as entries:
            for number, entry in enumerate(entries):
                if self._closed:
                    return
                fields = fields_of(entry.message)
                time_s = line.place_ns(entry.stamp_ns) * _NS
                for path, curve in curves.items():
                    if path in fields:
                        curve.add(time_s, fields[path])
                if number % _TURN == 0:
                    time.sleep(_REST_S)
                    for curve in curves.values():
                        curve.share = min(number / total, 0.99)

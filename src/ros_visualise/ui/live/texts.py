"""Search over the texts of messages, recorded or live: strings, lines of logs, diagnostics."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Mapping
from contextlib import closing, suppress
from typing import Any, NamedTuple

from ros_visualise.core import supervision
from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.messages.recorded import as_ros
from ros_visualise.messages.text_fields import may_have_texts, texts_of
from ros_visualise.runtime.base import Runtime
from ros_visualise.sources.recordings import Recording
from ros_visualise.ui.live.played import open_played
from ros_visualise.ui.live.rewinding import Rewinder

log = logging.getLogger(__name__)

_BATCH_LIVE = 5000  # messages read for one question
_AFTER_NS = 1000  # a message is shown that long after it came at the latest
_MOST, _MOST_CHARACTERS, _LONGEST = 100_000, 32 << 20, 4000
_FOUND, _EXCERPT = 20, 160
_BATCH, _PAUSE_S = 50, 0.001
_NS = 1e9


class _Said(NamedTuple):
    place_s: float
    topic: str
    text: str


class Texts:
    """Texts of messages, in which a person searches.

    Of equal texts of a topic that follow each other the first is kept.
    """

    def __init__(self) -> None:
        self._said: list[_Said] = []
        self._last: dict[str, str] = {}
        self._characters = 0
        self._share = 0.0

    def find(self, words: str) -> Mapping[str, Any]:
        """The first texts with all of these words, in any case.

        Returns:
            ``found`` as [[time of playback in seconds, topic, excerpt]], their ``count``, and the
            ``share`` of the messages that is read, 0 to 1.
        """
        self._read_on()
        share, wanted = self._share, words.casefold().split()
        said = [one for one in list(self._said) if _has(one.text.casefold(), wanted)]
        said.sort()
        found = [(one.place_s, one.topic, _excerpt(one.text, wanted)) for one in said[:_FOUND]]
        return {"found": found, "count": len(said), "share": share}

    def close(self) -> None:
        """End after the present message."""

    def _read_on(self) -> None:
        """Read what is not yet read, or begin to."""
        raise NotImplementedError

    @property
    def _is_full(self) -> bool:
        return len(self._said) >= _MOST or self._characters > _MOST_CHARACTERS

    def _note(self, place_s: float, topic: str, message: Any) -> None:
        """Keep the texts of a message, if it can be read."""
        text = ""
        with suppress(RosVisualiseError):
            text = "\n".join(texts_of(as_ros(message)))[:_LONGEST]
        if text and self._last.get(topic) != text:
            self._last[topic] = text
            self._said.append(_Said(place_s, topic, text))
            self._characters += len(text)


class RecordedTexts(Texts):
    """The texts of what is played, 100,000 at most; a thread reads them at the first search."""

    def __init__(self, runtime: Runtime) -> None:
        super().__init__()
        self._runtime = runtime
        self._closed = False
        self._thread: threading.Thread | None = None
        self._starting = threading.Lock()

    def close(self) -> None:
        self._closed = True

    def _read_on(self) -> None:
        with self._starting:
            self._thread = self._thread or supervision.start("texts", self._read)

    def _read(self) -> None:
        try:
            recording = open_played(self._runtime)
            if recording is not None:
                with closing(recording):
                    self._read_all(recording)
        except (RosVisualiseError, ValueError, OSError) as error:
            log.warning("cannot search messages: %s", error)
        self._share = 1.0

    def _read_all(self, recording: Recording) -> None:
        source = self._runtime.graph.source
        outputs = {} if source is None else source.outputs
        topics = [name for name, about in recording.topics.items() if may_have_texts(about.type)]
        total = sum(recording.topics[name].messages for name in topics) or 1
        with closing(recording.read(topics=topics)) as entries:
            for number, entry in enumerate(entries if topics else ()):
                if self._closed or self._is_full:
                    return
                topic = outputs.get(entry.topic, entry.topic)
                self._note(self._place_s(entry.stamp_ns), topic, entry.message)
                if number % _BATCH == 0:
                    time.sleep(_PAUSE_S)
                    self._share = min(number / total, 0.99)

    def _place_s(self, stamp_ns: int) -> float:
        playback = self._runtime.playback
        recorded = None if playback is None else playback.recorded
        return max(stamp_ns if recorded is None else recorded.place_ns(stamp_ns), 0) / _NS


class LiveTexts(Texts):
    """The texts of the last minutes of live topics, while they are in the buffer."""

    def __init__(self, rewinder: Rewinder) -> None:
        super().__init__()
        self._rewinder = rewinder
        self._number = 0
        self._reading = threading.Lock()

    def _read_on(self) -> None:
        with self._reading:
            buffer = self._rewinder.buffer
            first, kept = buffer.since(self._number, _BATCH_LIVE)
            self._number = first + len(kept)
            for one in kept:
                if one.topic in self._rewinder.text_topics:
                    self._note((one.place_ns + _AFTER_NS) / _NS, one.topic, one.message)
            begin_s = buffer.begin_ns / _NS
            self._said = [one for one in self._said if one.place_s >= begin_s][-_MOST:]
            self._share = 1.0 if len(kept) < _BATCH_LIVE else 0.5


def _has(text: str, wanted: list[str]) -> bool:
    return bool(wanted) and all(word in text for word in wanted)


def _excerpt(text: str, wanted: list[str]) -> str:
    """The part of a text around the first of the words, in one line."""
    at = max(text.casefold().find(wanted[0]) - _EXCERPT // 4, 0)
    return ("…" if at else "") + " ".join(text[at : at + _EXCERPT].split())

"""Search over the texts of a recording's messages: strings, lines of logs, diagnostics."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, suppress
from itertools import islice
from numbers import Real
from typing import Any, NamedTuple

import numpy as np

from ros_visualise.core import supervision
from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.data.fields import field_names
from ros_visualise.messages.recorded import as_ros
from ros_visualise.runtime.base import Runtime
from ros_visualise.sources.recordings import Entry, Recording
from ros_visualise.ui.live.played import open_played

log = logging.getLogger(__name__)

_FRAME = "frame_id"
_NAMES = ("encoding", "format", "distortion_model", "file", "function", "topics")
"""Fields that nobody searches."""
_FIRST = 3  # messages of a topic that show whether it has texts
_MOST, _MOST_CHARACTERS, _LONGEST = 100_000, 32 << 20, 4000
_FOUND, _EXCERPT = 20, 160
_BATCH, _PAUSE_S = 50, 0.001
_NS = 1e9


class _Said(NamedTuple):
    place_s: float
    topic: str
    text: str


class RecordedTexts:
    """The texts of what is played; a thread reads them when a person first searches.

    Of equal texts of a topic that follow each other the first is kept, and 100,000 in all.
    """

    def __init__(self, runtime: Runtime) -> None:
        self._runtime = runtime
        self._said: list[_Said] = []
        self._characters = 0
        self._share, self._closed = 0.0, False
        self._thread: threading.Thread | None = None
        self._starting = threading.Lock()

    def find(self, words: str) -> Mapping[str, Any]:
        """The first texts with all of these words, in any case.

        Returns:
            ``found`` as [[time of playback in seconds, topic, excerpt]], their ``count``, and the
            ``share`` of the recording that is read, 0 to 1.
        """
        with self._starting:
            self._thread = self._thread or supervision.start("texts", self._read)
        share, wanted = self._share, words.casefold().split()
        said = [one for one in list(self._said) if _has(one.text.casefold(), wanted)]
        said.sort()
        found = [(one.place_s, one.topic, _excerpt(one.text, wanted)) for one in said[:_FOUND]]
        return {"found": found, "count": len(said), "share": share}

    def close(self) -> None:
        """End after the present message."""
        self._closed = True

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
        topics = [name for name in recording.topics if _may_have_texts(recording, name)]
        total = sum(recording.topics[name].messages for name in topics) or 1
        last: dict[str, str] = {}
        with closing(recording.read(topics=topics)) as entries:
            for number, entry in enumerate(entries if topics else ()):
                if self._closed or len(self._said) >= _MOST or self._characters > _MOST_CHARACTERS:
                    return
                text = "\n".join(t for one in _readable([entry]) for t in texts_of(one))[:_LONGEST]
                if text and last.get(entry.topic) != text:
                    last[entry.topic] = text
                    topic = outputs.get(entry.topic, entry.topic)
                    self._said.append(_Said(self._place_s(entry.stamp_ns), topic, text))
                    self._characters += len(text)
                if number % _BATCH == 0:
                    time.sleep(_PAUSE_S)
                    self._share = min(number / total, 0.99)

    def _place_s(self, stamp_ns: int) -> float:
        playback = self._runtime.playback
        recorded = None if playback is None else playback.recorded
        return max(stamp_ns if recorded is None else recorded.place_ns(stamp_ns), 0) / _NS


def texts_of(message: Any) -> Iterator[str]:
    """The texts of a ROS message that are not empty, without those of frames, formats and files."""
    return (text for text in _strings(message) if text)


def _strings(value: Any) -> Iterator[str]:
    """Texts, also empty ones; an empty array, which may hold some in another message, is one."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, list | tuple):
        yield from (text for one in value for text in _strings(one)) if value else ("",)
    elif not isinstance(value, Real | bytes | np.ndarray | np.generic):
        for name, own in field_names(value.__class__).items():
            if name not in _NAMES and not name.endswith(_FRAME):
                yield from _strings(getattr(value, own))


def _may_have_texts(recording: Recording, topic: str) -> bool:
    with closing(recording.read(topics=[topic])) as entries:
        return any(any(True for _ in _strings(one)) for one in _readable(islice(entries, _FIRST)))


def _readable(entries: Iterable[Entry]) -> Iterator[Any]:
    """The ROS messages of those that are not damaged."""
    for entry in entries:
        with suppress(RosVisualiseError):
            yield as_ros(entry.message)


def _has(text: str, wanted: list[str]) -> bool:
    return bool(wanted) and all(word in text for word in wanted)


def _excerpt(text: str, wanted: list[str]) -> str:
    """The part of a text around the first of the words, in one line."""
    at = max(text.casefold().find(wanted[0]) - _EXCERPT // 4, 0)
    return ("…" if at else "") + " ".join(text[at : at + _EXCERPT].split())

"""Several recordings and films on one line of time."""

from __future__ import annotations

import heapq
import logging
import re
from collections.abc import Collection, Generator, Iterator, Mapping, Sequence
from contextlib import closing
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.core import supervision
from ros_visualise.core.errors import RosVisualiseError, UsageError
from ros_visualise.data import Transforms
from ros_visualise.messages.recorded import TopicType
from ros_visualise.messages.restamped import restamped
from ros_visualise.sources.playback import PlayedSource, RecordedTime
from ros_visualise.sources.recordings import (
    Entry,
    Extra,
    ImageAt,
    KeyImage,
    Loss,
    Recording,
    TopicInfo,
)
from ros_visualise.sources.recordings.joined_frames import own_frames

log = logging.getLogger(__name__)

MAX_OFFSET_S = 1e9
"""Largest offset of a recording that is played with others."""
_A_DATE_NS = 10**18  # in 2001; stamps before it count from the start of something


class JoinedRecording:
    """Recordings as one: messages in the order of their stamps, which are moved to one clock.

    Recordings that overlap keep their stamps, others begin together. Topics keep their names; those
    of several recordings are below the name of theirs, except transforms, which make one tree: see
    `own_frames`. One that fails ends by itself, which is a loss.

    Args:
        parts: they are open, and closed with it.
        origins_ns: of each part, the date of stamp 0, where its stamps only count from its start;
            None: unknown; 0: its stamps are of a clock.

    Attributes:
        names: of the parts, valid in names of topics and parameters.
        is_aligned: of each part, if it is aligned by its stamps.
        frames: of each part, the new names of its frames, or None.
        spans_ns: of each part, the stamps of its first and its last message.
    """

    def __init__(self, parts: Sequence[Recording], origins_ns: Sequence[int | None]) -> None:
        self._parts = parts
        self.paths = [one.path for one in parts]
        self.names = part_names(self.paths)
        self.path = Path(", ".join(path.name for path in self.paths))
        self.format = ", ".join(dict.fromkeys(one.format for one in parts))
        self.size = sum(one.size for one in parts)
        self.frames = own_frames(self.names, parts)
        self._places = self._place_topics()
        self._failures: list[str] = []
        placed = zip(parts, self._places, strict=True)
        named = {name: one.topics[own] for one, at in placed for name, own in at.items()}
        self.topics: Mapping[str, TopicInfo] = dict(sorted(named.items()))
        known_ns = [by_ns or 0 for by_ns in origins_ns]
        timed = list(zip(parts, known_ns, strict=True))
        spans_ns = [(one.start_ns + by_ns, one.end_ns + by_ns) for one, by_ns in timed]
        dated = [one.start_ns >= _A_DATE_NS for one in parts]
        first_ns, last_ns = spans_ns[dated.index(True) if any(dated) else 0]
        self.is_aligned = [
            by_ns is not None and start <= last_ns and first_ns <= end
            for by_ns, (start, end) in zip(origins_ns, spans_ns, strict=True)
        ]
        self._alignments_ns = [
            by_ns if is_aligned else by_ns + first_ns - start
            for by_ns, is_aligned, (start, _) in zip(
                known_ns, self.is_aligned, spans_ns, strict=True
            )
        ]
        self.move([0.0] * len(parts))

    def move(self, offsets_s: Sequence[float]) -> None:
        """Move each part to so much later; not while it is read."""
        offsets_ns = [round(offset_s * 1e9) for offset_s in offsets_s]
        self._shifts_ns = np.add(self._alignments_ns, offsets_ns).tolist()
        moved = zip(self._parts, self._shifts_ns, strict=True)
        self.spans_ns = [(one.start_ns + by_ns, one.end_ns + by_ns) for one, by_ns in moved]
        self.start_ns = min(start_ns for start_ns, _ in self.spans_ns)
        self.end_ns = max(end_ns for _, end_ns in self.spans_ns)

    @property
    def recordings(self) -> Sequence[Recording]:
        """The parts, with their own stamps."""
        return self._parts

    @property
    def parts(self) -> Sequence[Collection[str]]:
        """The topics of each part."""
        return self._places

    def sources(self, line: RecordedTime) -> tuple[PlayedSource, ...]:
        """The parts on the line of a playback."""
        return tuple(
            PlayedSource(name, path.name, line.place_ns(start) / 1e9, line.place_ns(end) / 1e9, own)
            for name, path, (start, end), own in zip(
                self.names, self.paths, self.spans_ns, self.is_aligned, strict=True
            )
        )

    @property
    def loss(self) -> Loss:
        """The losses of all parts."""
        loss = Loss()
        for one in self._parts:
            loss.add("", one.loss.messages, one.loss.bytes)
            for note in one.loss.notes:
                loss.add(f"{one.path.name}: {note}")
        for note in self._failures:
            loss.add(note)
        return loss

    @property
    def compression(self) -> str:
        return ", ".join(dict.fromkeys(one.compression for one in self._parts))

    def read(
        self,
        start_ns: int | None = None,
        stop_ns: int | None = None,
        topics: Collection[str] | None = None,
    ) -> Generator[Entry, None, None]:
        numbers = range(len(self._parts))
        readings = [self._read(number, start_ns, stop_ns, topics) for number in numbers]
        try:
            yield from heapq.merge(*readings, key=lambda entry: entry.stamp_ns)
        finally:
            for reading in readings:
                reading.close()

    def newest(
        self, since_ns: int, stamp_ns: int, topics: Collection[str]
    ) -> Generator[Entry, None, None]:
        """Messages of a range, both ends included, with the last one of each topic.

        Others of films may be missing, whose last images are there even if they are older.
        """
        for number, part in enumerate(self._parts):
            wanted = topics
            if isinstance(part, ImageAt) and stamp_ns >= self.spans_ns[number][0]:
                by_ns = self._shifts_ns[number]
                own, image_ns, image = part.image_at(stamp_ns - by_ns)
                name = next(name for name, one in self._places[number].items() if one == own)
                wanted = [topic for topic in topics if topic != name]
                if name in topics:
                    renamed = restamped(image, by_ns, self.frames[number])
                    yield Entry(name, image_ns + by_ns, renamed)
            yield from self._read(number, since_ns, stamp_ns + 1, wanted)

    def key_image(self, topic: str) -> KeyImage | None:
        """The function that finds key images, if a topic is of a film."""
        for part, places, by_ns in zip(self._parts, self._places, self._shifts_ns, strict=True):
            if topic in places and isinstance(part, ImageAt) and part.key_image is not None:
                return partial(_key_image, part.key_image, by_ns)
        return None

    def covers(self, topic: str, stamp_ns: int) -> bool:
        """True if the source of a topic has begun and not ended at a time."""
        spans = zip(self._places, self.spans_ns, strict=True)
        return any(topic in at and start <= stamp_ns <= end for at, (start, end) in spans)

    def stamps_ns(self) -> Mapping[str, npt.NDArray[np.int64]]:
        found: dict[str, list[npt.NDArray[np.int64]]] = {}
        for one, places, by_ns in zip(self._parts, self._places, self._shifts_ns, strict=True):
            own_ns = one.stamps_ns()
            for name, own in places.items():
                found.setdefault(name, []).append(own_ns[own] + by_ns)
        return {name: np.sort(np.concatenate(several)) for name, several in found.items()}

    def extras(self) -> Iterator[Extra]:
        return chain(*(one.extras() for one in self._parts))

    def close(self) -> None:
        for one in self._parts:
            one.close()

    def _place_topics(self) -> list[dict[str, str]]:
        """Names of topics -> their own names in a part, for each part."""
        kinds: dict[str, list[TopicType]] = {}
        for one in self._parts:
            for topic, info in one.topics.items():
                kinds.setdefault(topic, []).append(info.type)
        shared = {topic for topic, several in kinds.items() if _is_shared(several)}
        return [
            {own if own in shared else f"/{name}{own}": own for own in one.topics}
            for name, one in zip(self.names, self._parts, strict=True)
        ]

    def _read(
        self, number: int, start_ns: int | None, stop_ns: int | None, topics: Collection[str] | None
    ) -> Generator[Entry, None, None]:
        """The messages of one part; if it fails, that is noted."""
        part, by_ns, frames = self._parts[number], self._shifts_ns[number], self.frames[number]
        names = {own: name for name, own in self._places[number].items()}
        wanted = [own for own, name in names.items() if topics is None or name in topics]
        if not wanted:
            return
        begin_ns, end_ns = (at if at is None else at - by_ns for at in (start_ns, stop_ns))
        try:
            with closing(part.read(begin_ns, end_ns, wanted)) as entries:
                for topic, stamp_ns, message in entries:
                    moved = restamped(message, by_ns, frames)
                    yield Entry(names[topic], stamp_ns + by_ns, moved)
        except supervision.ERRORS as error:
            if not isinstance(error, (RosVisualiseError, OSError)):
                supervision.note(part.path.name, error)
            note = f"{part.path.name}: ended early: {error or type(error).__name__}"
            if note not in self._failures:
                self._failures.append(note)
                log.warning("%s", note)


def _is_shared(kinds: Sequence[TopicType]) -> bool:
    """True if messages of these types, of all recordings with a topic, may be on it together."""
    is_one = len(kinds) == 1
    return is_one or (kinds[0].data_class is Transforms and len({one.name for one in kinds}) == 1)


def _key_image(find: KeyImage, by_ns: int, stamp_ns: int) -> tuple[int, Any] | None:
    found = find(max(stamp_ns - by_ns, 0))
    return None if found is None else (found[0] + by_ns, found[1])


def parse_offsets(texts: Sequence[str], joined: JoinedRecording) -> list[float]:
    """The offset of each part, s, by the texts of ``--offset``: ``NAME=SECONDS``.

    Raises:
        UsageError: another form, or no such part.
    """
    found = dict.fromkeys(joined.names, 0.0)
    named = {path.name: name for name, path in zip(joined.names, joined.paths, strict=True)}
    named |= {name: name for name in joined.names}
    for text in texts:
        name, _, value = text.rpartition("=")
        if name not in named:
            raise UsageError(
                f"--offset {text}: give NAME=SECONDS, with NAME one of {', '.join(joined.names)}"
            )
        try:
            found[named[name]] = float(value)
        except ValueError:
            raise UsageError(f"--offset {text}: {value!r} is not a number of seconds") from None
        if not abs(found[named[name]]) <= MAX_OFFSET_S:
            raise UsageError(f"--offset {text}: must be from {-MAX_OFFSET_S:g} to {MAX_OFFSET_S:g}")
    return [*found.values()]


def part_names(paths: Sequence[Path]) -> list[str]:
    """A name for each file: without its suffix where these names differ; valid in topics."""
    for words in ([path.stem for path in paths], [path.name for path in paths]):
        names = [_as_name(word) for word in words]
        if len(set(names)) == len(names):
            return names
    return [f"{name}_{number}" for number, name in enumerate(names, 1)]


def _as_name(word: str) -> str:
    name = re.sub("[^A-Za-z0-9]+", "_", word).strip("_")
    return name if name[:1].isalpha() else f"source_{name}".strip("_")

"""One recording in several files; each can be read by itself."""

from __future__ import annotations

import glob
import re
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from ros_visualise.core.errors import DamagedMessage, OpenError, RecordingError, UsageError
from ros_visualise.messages.latched import Latched
from ros_visualise.messages.recorded import TopicType, recorded_ns
from ros_visualise.sinks import Recorder
from ros_visualise.sinks.chunked import END_NS, ChunkedRecorder
from ros_visualise.sinks.encoding import TopicDeclaration
from ros_visualise.sources.recordings import Extra

_SIZES = {"K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40}
_SPANS_S = {"s": 1, "m": 60, "h": 3600}
_LEAST_BYTES = 2**16
_NS = 1_000_000_000

OpenPart = Callable[[int, Mapping[str, TopicType]], ChunkedRecorder]
"""Opens the file of that number, with these topics."""


@dataclass(frozen=True)
class Split:
    """The limits of a file, bytes or nanoseconds; None: no limit."""

    size: int | None = None
    span_ns: int | None = None


def parse_split(text: str) -> Split:
    """``1G`` or ``500M`` for bytes, ``10m``, ``90s`` or ``1h`` for a time.

    Raises:
        UsageError: it is neither, or too little.
    """
    found = re.fullmatch(r"(\d{1,9}(?:\.\d{1,6})?)([KMGTsmh])B?", text)
    number, unit = (float(found[1]), found[2]) if found else (0.0, "K")
    if unit in _SPANS_S and number * _SPANS_S[unit] >= 1:
        return Split(span_ns=round(number * _SPANS_S[unit] * _NS))
    if unit in _SIZES and number * _SIZES[unit] >= _LEAST_BYTES:
        return Split(size=round(number * _SIZES[unit]))
    raise UsageError(
        f"split {text}: give a size such as 1G or 500M (at least 64K), or a time such as 10m, 90s"
        " or 1h"
    )


def part_path(path: Path, number: int) -> Path:
    """The name of a part: ``run_0.bag`` of ``run.bag``."""
    return path.with_name(f"{path.stem}_{number}{path.suffix}")


def existing_parts(path: Path) -> dict[int, Path]:
    """Existing parts: number -> file."""
    name = re.compile(f"{re.escape(path.stem)}_(0|[1-9]\\d*){re.escape(path.suffix)}")
    there = path.parent.glob(f"{glob.escape(path.stem)}_*{glob.escape(path.suffix)}")
    return {int(found[1]): one for one in there if (found := name.fullmatch(one.name))}


class PartInfo(NamedTuple):
    """A file: its name, times of its messages, and number of messages by topic."""

    path: Path
    start_ns: int
    end_ns: int
    counts: Mapping[str, int]


class PartedRecorder(Recorder):
    """Any number of topics in a series of files.

    Each file is finished before the next one begins, and begins with the last messages that still
    hold: static frames, latched topics, calibrations, and the values of all parameters.

    Args:
        open_part: opens a file; raises as `ChunkedRecorder`.
        topics: topic -> type of its messages.
        split: the limits of a file.
    """

    def __init__(
        self, open_part: OpenPart, topics: Mapping[str, TopicType], split: Split = Split()
    ) -> None:
        self._open_part, self._split = open_part, split
        self._types = dict(topics)
        self._latched = Latched()
        for topic, kind in topics.items():
            self._latched.add(topic, kind)
        self._done: list[PartInfo] = []
        self._unplaced: Counter[str] = Counter()
        self._first_ns: int | None = None  # the start time of this part
        self._head_bytes = 0  # of the messages that still hold, which do not count
        self._part = open_part(0, self._types)
        self._first = self._part.path

    @property
    def path(self) -> Path:
        """The first file."""
        return self._first if self._done else self._part.path

    @property
    def parts(self) -> list[PartInfo]:
        """All files, including the current one."""
        part = self._part
        return [*self._done, PartInfo(part.path, part.start_ns, part.end_ns, part.counts)]

    @property
    def files(self) -> int:
        return len(self._done) + 1

    @property
    def topics(self) -> tuple[str, ...]:
        return tuple(self._types)

    @property
    def declared(self) -> Mapping[str, TopicDeclaration]:
        """Topic -> its declaration in the files."""
        return self._part.declared

    @property
    def unplaced(self) -> Mapping[str, int]:
        return self._unplaced + self._part.unplaced

    def add(self, topic: str, kind: TopicType) -> None:
        self._part.add(topic, kind)
        self._types[topic] = kind
        self._latched.add(topic, kind)

    def add_extra(self, extra: Extra) -> None:
        self._part.add_extra(extra)

    def write(self, topic: str, message: Any, stamp_ns: int | None = None) -> None:
        if topic not in self._types:
            return
        at_ns = recorded_ns(message) if stamp_ns is None else stamp_ns
        if 0 <= at_ns < END_NS:  # else it is refused, and no time to begin at
            if self._is_full(at_ns):
                self._begin_next(at_ns)
            self._first_ns = at_ns if self._first_ns is None else self._first_ns
        self._part.unthrottled = self.unthrottled
        self._part.write(topic, message, stamp_ns)
        self._latched.keep(topic, message)

    def close(self, whole: bool = True) -> None:
        self._part.close(whole)

    def remove(self) -> None:
        self._part.remove()
        for part in self._done:
            part.path.unlink(missing_ok=True)

    def _is_full(self, at_ns: int) -> bool:
        if self._first_ns is None:
            return False
        size, span_ns = self._split.size, self._split.span_ns
        is_long = span_ns is not None and abs(at_ns - self._first_ns) >= span_ns
        return is_long or (size is not None and self._part.size - self._head_bytes >= size)

    def _begin_next(self, at_ns: int) -> None:
        """End this file, and begin the next one with the messages that still hold.

        Raises:
            RecordingError: it cannot be written.
        """
        self._part.close()
        done, self._done = self._done, self.parts
        self._unplaced += self._part.unplaced
        try:
            self._part = self._open_part(len(self._done), self._types)
        except OpenError as error:
            self._done = done
            raise RecordingError(str(error)) from error
        self._first_ns = at_ns
        for topic, message in self._latched.messages(at_ns):
            with suppress(DamagedMessage):  # of one that was written before
                self._part.write(topic, message, at_ns)
        self._head_bytes = self._part.size


class SplitRecorder(PartedRecorder):
    """A series of files beside one another: ``run_0.mcap``, ``run_1.mcap`` and so on.

    Args:
        path: the base of their names.
        open_file: opens one of them.
        topics, split: as of `PartedRecorder`.
        overwrite: replace those of an earlier recording.

    Raises:
        OpenError: files of such names exist, or they cannot be written.
    """

    def __init__(
        self,
        path: Path,
        open_file: Callable[[Path, Mapping[str, TopicType]], ChunkedRecorder],
        topics: Mapping[str, TopicType],
        split: Split,
        overwrite: bool,
    ) -> None:
        there = existing_parts(path)
        if there and not overwrite:
            first = there[min(there)]
            raise OpenError(f"{first} exists; choose another name, or replace it with --overwrite")
        self._name = path
        super().__init__(
            lambda number, types: open_file(part_path(path, number), types), topics, split
        )

    def close(self, whole: bool = True) -> None:
        """Finish the file; a complete recording also deletes the later parts of an old one."""
        super().close(whole)
        number = self.files
        while whole and (file := part_path(self._name, number)).is_file():
            file.unlink()
            number += 1

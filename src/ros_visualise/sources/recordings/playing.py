"""A recording as `ros_visualise.sources.playback.Playback` plays it."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Collection, Generator, Iterable
from contextlib import closing

import numpy as np
import numpy.typing as npt

from ros_visualise.sources.recordings import Entry, Recording
from ros_visualise.sources.recordings.joined import JoinedRecording

_LONGEST_NS = 3600 * 1_000_000_000
_LEFT_NS = 1_000_000_000  # of a gap that is longer
Batch = tuple[Entry, ...]
"""Messages that pass together."""
_TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_LOOK_BACK_NS = (1_000_000_000, 10_000_000_000, 2**62)


class PlayedTime:
    """The place of each stamp of a recording on the line of time, which begins at 0.

    Args:
        stamps_ns: (N,) in order, N > 0: those of played messages, its start and its end.

    Attributes:
        gaps_ns: lengths of the gaps that are skipped but for a second, in their order.
    """

    def __init__(self, stamps_ns: npt.NDArray[np.int64]) -> None:
        steps_ns = np.diff(stamps_ns)
        before = np.flatnonzero(steps_ns > _LONGEST_NS)
        self.gaps_ns = [int(length) for length in steps_ns[before]]
        # after each gap a part begins, of the recording and of the line
        self._starts_ns = [int(stamps_ns[0]), *(int(stamps_ns[i + 1]) for i in before)]
        skipped_ns: list[int] = np.cumsum(
            [0, *(length - _LEFT_NS for length in self.gaps_ns)]
        ).tolist()
        origin_ns = self._starts_ns[0]
        self._places_ns: list[int] = [
            start_ns - origin_ns - skipped
            for start_ns, skipped in zip(self._starts_ns, skipped_ns, strict=True)
        ]

    def place_ns(self, stamp_ns: int) -> int:
        """The place of a stamp; at the start for those before it."""
        part = max(bisect_right(self._starts_ns, stamp_ns) - 1, 0)
        place_ns = self._places_ns[part] + max(stamp_ns - self._starts_ns[part], 0)
        return min([place_ns, *self._places_ns[part + 1 : part + 2]])

    def stamp_ns(self, place_ns: int) -> int:
        """The time of the recording at a place."""
        part = max(bisect_right(self._places_ns, place_ns) - 1, 0)
        return self._starts_ns[part] + place_ns - self._places_ns[part]


def played_time(recording: Recording, topics: Collection[str]) -> PlayedTime:
    """The line for these topics of a recording; its stamps are read only if it is that long."""
    ends_ns = [recording.start_ns, recording.end_ns]
    if ends_ns[1] - ends_ns[0] <= _LONGEST_NS:
        return PlayedTime(np.array(ends_ns, np.int64))
    found = recording.stamps_ns()
    stamps_ns = np.concatenate([ends_ns, *(found[topic] for topic in topics)])
    return PlayedTime(np.sort(stamps_ns.astype(np.int64)))


class PlayableRecording:
    """Some topics of a recording from any time on, without its long gaps.

    If reading begins in the middle, the first batch holds what is shown at that time: the last
    message of each topic, the transforms of the last second, and all that was latched.
    ``step_topic`` gives the topic that is stepped through at the moment; empty: any, as at times
    that its source, one of several, does not cover.
    """

    def __init__(
        self, recording: Recording, topics: Collection[str], step_topic: Callable[[], str]
    ) -> None:
        self._recording = recording
        self._topics = tuple(topics)
        self._step_topic = step_topic
        self.time = played_time(recording, self._topics)
        info = recording.topics
        self._transforms = {t for t in topics if info[t].type.name in _TRANSFORMS}
        self._latched = {
            t for t in topics if info[t].type.qos.transient_local or t.endswith("/tf_static")
        }

    @property
    def duration_ns(self) -> int:
        """From its first to its last message, without the gaps."""
        return self.time.place_ns(self._recording.end_ns)

    def is_frame(self, batch: Batch) -> bool:
        """True if a person steps to it."""
        return self._is_stepped(batch[-1])

    def read(self, start_ns: int) -> Generator[tuple[int, Batch], None, None]:
        """(Time since the first message, messages), from those shown at ``start_ns`` on."""
        place_ns, start_stamp_ns = self.time.place_ns, self.time.stamp_ns(start_ns)
        if start_ns > 0:
            shown = self._shown_at(start_stamp_ns)
            if shown:
                yield place_ns(shown[-1].stamp_ns), shown
        after_ns = start_stamp_ns + 1 if start_ns > 0 else None
        with closing(self._recording.read(after_ns, topics=self._topics)) as entries:
            for entry in entries:
                yield place_ns(entry.stamp_ns), (entry,)

    def _shown_at(self, stamp_ns: int) -> Batch:
        """The messages shown at a time: the last one is of the topics that are stepped through."""
        for back_ns in _LOOK_BACK_NS:
            since_ns = max(stamp_ns - back_ns, self._recording.start_ns)
            window = self._newest(since_ns, stamp_ns)
            if any(map(self._is_stepped, window)):
                return (*self._latched_before(since_ns), *self._frame_last(window))
        return ()

    def _newest(self, since_ns: int, stamp_ns: int) -> list[Entry]:
        """The last message of each topic, and all that add to one another."""
        kept: list[Entry] = []
        last: dict[str, Entry] = {}
        adding = self._transforms | self._latched
        with closing(self._read_window(since_ns, stamp_ns)) as entries:
            for entry in entries:
                if entry.topic in adding:
                    kept.append(entry)
                else:
                    last[entry.topic] = entry
        return sorted([*kept, *last.values()], key=lambda entry: entry.stamp_ns)

    def _read_window(self, since_ns: int, stamp_ns: int) -> Generator[Entry, None, None]:
        if isinstance(self._recording, JoinedRecording):
            return self._recording.newest(since_ns, stamp_ns, self._topics)
        return self._recording.read(since_ns, stamp_ns + 1, self._topics)

    def _frame_last(self, window: Iterable[Entry]) -> list[Entry]:
        entries = list(window)
        at = max(i for i, entry in enumerate(entries) if self._is_stepped(entry))
        return [*entries[:at], *entries[at + 1 :], entries[at]]

    def _is_stepped(self, entry: Entry) -> bool:
        topic, recording = self._step_topic(), self._recording
        if topic in ("", entry.topic):
            return True
        if not isinstance(recording, JoinedRecording):
            return False
        return not recording.covers(topic, entry.stamp_ns)

    def _latched_before(self, stamp_ns: int) -> list[Entry]:
        if not self._latched:
            return []
        with closing(self._recording.read(None, stamp_ns, self._latched)) as entries:
            return list(entries)

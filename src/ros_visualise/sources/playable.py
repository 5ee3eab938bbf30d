"""What can be played, and what shows of it."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import closing
from typing import NamedTuple, Protocol, TypeVar

T_co = TypeVar("T_co", covariant=True)


class Playable(Protocol[T_co]):
    """A source that can be read again from any time on."""

    @property
    def duration_ns(self) -> int | None:
        """Its length, if it is known; it may turn out to be wrong."""

    def read(self, start_ns: int) -> Generator[tuple[int, T_co], None, None]:
        """(Time since its start, item) in order of time, from the item shown at ``start_ns`` on.

        That is the last one not after ``start_ns``; past the end it is the last one of all.
        """


class PlaybackState(NamedTuple):
    """What a page shows of a playback; ``duration_s`` is None where it is not known.

    ``part_s`` is the part that is played, with None where it ends with the recording.
    """

    position_s: float
    duration_s: float | None
    playing: bool
    ended: bool
    rate: float
    loop: bool
    part_s: tuple[float, float | None]


def time_before(source: Playable[object], time_ns: int, items_back: int) -> int:
    """The time of the item a number of items before the one shown at a time; at least 0."""
    for _ in range(items_back):
        if time_ns <= 0:
            break
        with closing(source.read(max(0, time_ns - 1))) as items:
            time_ns, _ = next(items, (0, None))
    return time_ns

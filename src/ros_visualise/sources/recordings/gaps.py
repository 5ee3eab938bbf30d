"""The line of time on which a recording is played: that of its stamps, without its long gaps.

One stray stamp, or a night between two drives, would else make nearly all of it a wait.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection

import numpy as np
import numpy.typing as npt

from ros_visualise.sources.recordings import Recording

_LONGEST_NS = 3600 * 1_000_000_000
_LEFT_NS = 1_000_000_000  # of a gap that is longer


class PlayedTime:
    """Where on the line, which begins at 0, each stamp of a recording is.

    Args:
        stamps_ns: (N,) in order, N > 0: those at which something is played, its start and its end.

    Attributes:
        gaps_ns: how long each gap was that is skipped but for a second, in their order.
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
        """Where a stamp is; what is before the start is there."""
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

"""The time of what is shown."""

from __future__ import annotations

from collections.abc import Callable


class DataTime:
    """That of the newest message, and on from there where nobody can stop it.

    Args:
        clock: seconds.

    Attributes:
        is_live: what is shown cannot be paused, and time goes on where nothing comes.
        newest_ns: the newest stamp.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self.is_live = False
        self.newest_ns, self._came_s = 0, 0.0

    def see(self, stamp_ns: int) -> None:
        """A message of this stamp has come."""
        if stamp_ns > self.newest_ns:
            self.newest_ns, self._came_s = stamp_ns, self._clock()

    def forget(self) -> None:
        """Time jumped: begin anew."""
        self.newest_ns, self._came_s = 0, 0.0

    @property
    def now_ns(self) -> int:
        """The time of the data."""
        passed_s = self._clock() - self._came_s if self.is_live else 0.0
        return self.newest_ns + round(passed_s * 1e9)

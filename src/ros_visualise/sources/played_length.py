"""How long what is played lasts: as its source promises, until its end is seen."""

from __future__ import annotations

import math

from ros_visualise.core.errors import UsageError

_DEFAULT_PERIOD_NS = 33_333_333  # of a recording that holds a single message


class PlayedLength:
    """The length of a source; ``promised_ns`` is None where it is not known."""

    def __init__(self) -> None:
        self.promised_ns: int | None = None
        self._period_ns = 0

    @property
    def seconds(self) -> float | None:
        """As it is promised."""
        return None if self.promised_ns is None else self.promised_ns / 1e9

    def within(self, time_ns: int) -> int:
        """A time that there is, the nearest one to a time."""
        end_ns = math.inf if self.promised_ns is None else self.promised_ns
        return int(max(0, min(time_ns, end_ns)))

    def pass_message(self, gap_ns: int) -> None:
        """A message came so long after the one before it."""
        self._period_ns = gap_ns

    def end(self, position_ns: int) -> None:
        """Whatever was promised, this is the end."""
        known_ns, period_ns = self.promised_ns or 0, self._period_ns
        if not 0 < known_ns - position_ns <= (2 * period_ns or known_ns):
            self.promised_ns = position_ns + (period_ns or _DEFAULT_PERIOD_NS)


def check_start(start_ns: int, duration_ns: int | None) -> None:
    """Refuse to start where there is nothing.

    Raises:
        UsageError: the start lies after the end.
    """
    if duration_ns and start_ns > duration_ns:
        start, end = start_ns / 1e9, duration_ns / 1e9
        raise UsageError(f"it cannot start at {start:g} s: it lasts {end:.2f} s")

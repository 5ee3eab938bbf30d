"""The part of a recording that is played: between two marks."""

from __future__ import annotations

from ros_visualise.core.errors import ParameterError


class Marks:
    """Two times since the start, both belonging to the part; their user holds a lock.

    Attributes:
        begin_ns: where it begins.
        end_ns: where it ends; None: where the recording does.
        next_ns: of the first message after the end, as soon as it was reached; else None.
    """

    def __init__(self) -> None:
        self.begin_ns = 0
        self.end_ns: int | None = None
        self.next_ns: int | None = None
        self._floor_ns = self._last_ns = 0
        self._is_first = True

    @property
    def part_s(self) -> tuple[float, float | None]:
        """Both, in seconds."""
        return self.begin_ns / 1e9, None if self.end_ns is None else self.end_ns / 1e9

    def set(self, begin_ns: int, end_ns: int | None) -> None:
        """Put them elsewhere.

        Raises:
            ParameterError: the end does not come after the beginning.
        """
        if begin_ns < 0 or (end_ns is not None and end_ns <= begin_ns):
            raise ParameterError("the end of the part to be played has to come after its beginning")
        self.begin_ns, self.end_ns = begin_ns, end_ns

    def has(self, time_ns: int) -> bool:
        """Whether a time lies in the part."""
        return self.begin_ns <= time_ns and (self.end_ns is None or time_ns <= self.end_ns)

    def enter(self, start_ns: int) -> None:
        """Reading begins somewhere, also outside."""
        self._last_ns, self._floor_ns, self.next_ns = start_ns, 0, None
        self._is_first = True

    def begin_lap(self, length_ns: int) -> int:
        """Reading begins at the first mark again: how long the lap was that ends here.

        The first message then takes the place of the one that would have come next.

        Args:
            length_ns: of the recording.
        """
        lap_ns = (length_ns if self.next_ns is None else self.next_ns) - self.begin_ns
        self.enter(self.begin_ns)
        self._floor_ns = self.begin_ns
        return max(lap_ns, 0)

    def place(self, time_ns: int) -> int:
        """When a message is shown: what is still seen at the beginning of a lap, then."""
        return max(time_ns, self._floor_ns)

    def end_before(self, time_ns: int) -> bool:
        """Whether the end lies between the last message and the next one, at a time.

        Never before the first one that is read: a part without messages shows that.
        """
        end_ns = None if self._is_first else self.end_ns
        is_end = end_ns is not None and self._last_ns <= end_ns < time_ns
        self.next_ns = time_ns if is_end else None
        return is_end

    def passed(self, time_ns: int) -> None:
        """A message was shown."""
        self._last_ns = self._last_ns if self._is_first else time_ns
        self._is_first = False

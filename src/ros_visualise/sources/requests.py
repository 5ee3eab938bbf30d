"""What was asked of a playback and is not done yet."""

from __future__ import annotations


class Requests:
    """Steps, seeks and restarts that wait; its user holds a lock.

    Attributes:
        steps: how many more messages to show while paused.
        target_ns: the time to seek, if there is one.
        start_over: at the end, play from the start again.
        reopen: open the source anew.
    """

    def __init__(self) -> None:
        self.steps = 0
        self.target_ns: int | None = None
        self.start_over = self.reopen = False
        self._steps_back = 0

    @property
    def lead_away(self) -> bool:
        """Something other than the next message was asked for."""
        return self.reopen or self.target_ns is not None or self._steps_back > 0

    def step(self, frames: int) -> None:
        """Show a number of messages more; a negative number goes back."""
        if frames >= 0:
            self.steps += frames
        else:
            self.steps, self._steps_back = 0, self._steps_back - frames

    def seek(self, time_ns: int) -> None:
        """Go to a time; this cancels all steps."""
        self.target_ns = time_ns
        self.steps = self._steps_back = 0

    def take_place(self, position_ns: int) -> tuple[int, int]:
        """Where to go from a position: a time, and a number of messages to go back from it."""
        place = (position_ns if self.target_ns is None else self.target_ns), self._steps_back
        self.target_ns, self._steps_back, self.start_over = None, 0, False
        return place

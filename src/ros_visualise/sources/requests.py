"""What somebody who looks on asked of a playback, until it is done."""

from __future__ import annotations


class Requests:
    """Steps, other places and new starts; whoever uses it holds a lock.

    Attributes:
        steps: how many messages more are to be shown though it is paused.
        target_ns: the time to go to, if there is one.
        start_over: at the end, it is to be played from the start again.
        reopen: the source is to be opened anew.
    """

    def __init__(self) -> None:
        self.steps = 0
        self.target_ns: int | None = None
        self.start_over = self.reopen = False
        self._steps_back = 0

    @property
    def lead_away(self) -> bool:
        """Something else than the next message is wanted."""
        return self.reopen or self.target_ns is not None or self._steps_back > 0

    def step(self, frames: int) -> None:
        """Show so many messages more; less than 0 are as many back."""
        if frames >= 0:
            self.steps += frames
        else:
            self.steps, self._steps_back = 0, self._steps_back - frames

    def seek(self, time_ns: int) -> None:
        """Go to a time, in place of all steps."""
        self.target_ns = time_ns
        self.steps = self._steps_back = 0

    def take_place(self, position_ns: int) -> tuple[int, int]:
        """Where to go from a position: to a time, and from there so many messages back."""
        place = (position_ns if self.target_ns is None else self.target_ns), self._steps_back
        self.target_ns, self._steps_back, self.start_over = None, 0, False
        return place

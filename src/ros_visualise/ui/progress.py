"""No user interface: a progress bar on standard error, where that is a terminal."""

from __future__ import annotations

import time

from tqdm import tqdm

from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.feed import Feed
from ros_visualise.ui.shown import teller


class Progress:
    """Shows how far a playback has come, in seconds of its source."""

    stays = False
    closed = awaited = False

    def __init__(self) -> None:
        self._runtime: Runtime | None = None
        self._status: Feed | None = None
        self._bar: tqdm[None] | None = None

    def open(self, runtime: Runtime) -> None:
        """Show the progress of this graph's source, and what a robot says that it does."""
        self._runtime, self._status = runtime, Feed(runtime)
        if runtime.playback is not None:
            self._status.follow(teller(runtime.graph)[1])
            self._bar = tqdm(unit="s", disable=None, dynamic_ncols=True, leave=False)

    def spin(self, timeout_s: float) -> None:
        """Wait, then bring the bar up to date."""
        time.sleep(timeout_s)
        if self._runtime is None or self._bar is None or self._runtime.playback is None:
            return
        told = self._status.take() if self._status else None
        if told is not None:
            self._bar.set_description_str(told.text, refresh=False)
        state = self._runtime.playback.state
        self._bar.total = state.duration_s and round(state.duration_s, 1)
        self._bar.n = round(state.position_s, 1)
        self._bar.refresh()

    def close(self) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.close()

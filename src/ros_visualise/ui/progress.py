"""A progress bar on standard error, if that is a terminal."""

from __future__ import annotations

import time

from tqdm import tqdm

from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.feed import Feed
from ros_visualise.ui.shown import robot_status


class Progress:
    """The progress of a playback, in seconds of its source."""

    stays = False
    closed = awaited = False

    def __init__(self) -> None:
        self._runtime: Runtime | None = None
        self._status: Feed | None = None
        self._bar: tqdm[None] | None = None

    def open(self, runtime: Runtime) -> None:
        """Show the progress of this graph's source, and a robot's status."""
        self._runtime, self._status = runtime, Feed(runtime)
        if runtime.playback is not None:
            self._status.follow(robot_status(runtime.graph)[1])
            self._bar = tqdm(unit="s", disable=None, dynamic_ncols=True, leave=False)

    def spin(self, timeout_s: float) -> None:
        """Wait, then update the bar."""
        time.sleep(timeout_s)
        if self._runtime is None or self._bar is None or self._runtime.playback is None:
            return
        status = self._status.take() if self._status else None
        if status is not None:
            self._bar.set_description_str(status.text, refresh=False)
        state = self._runtime.playback.state
        self._bar.total = state.duration_s and round(state.duration_s, 1)
        self._bar.n = round(state.position_s, 1)
        self._bar.refresh()

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()

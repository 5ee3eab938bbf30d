"""The range of a recording that is played."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import viser

from ros_visualise.sources.playback import Playback
from ros_visualise.ui.live.clock import begin_at, end_at
from ros_visualise.ui.page.controls import set_value
from ros_visualise.ui.page.worker import Worker

_BEGIN, _END, _NONE = "Set start", "Set end", "Clear"


class PlaybackRange:
    """A folder with start and end as numbers and buttons; the keys [ and ] set them too.

    Zero stands for the start or the end of the recording.
    """

    def __init__(self, gui: viser.GuiApi, playback: Playback, worker: Worker) -> None:
        self._playback = playback
        begin_s, end_s = self._shown_s = playback.state.part_s
        with gui.add_folder("Playback range", expand_by_default=False):
            self._from = gui.add_number(
                "Start", begin_s, min=0.0, step=0.01, hint="Start, seconds; the [ key sets it"
            )
            self._to = gui.add_number(
                "End",
                end_s or 0.0,
                min=0.0,
                step=0.01,
                hint="End, seconds (0 = end of recording); the ] key sets it",
            )
            buttons = gui.add_button_group("Range", (_BEGIN, _END, _NONE))
        self._from.on_update(worker.listener("part from", partial(begin_at, playback)))
        self._to.on_update(worker.listener("part to", partial(end_at, playback)))
        buttons.on_click(worker.listener(None, self._press))

    def refresh(self) -> None:
        part_s = self._playback.state.part_s
        if part_s != self._shown_s:  # else it would undo what a person sets just now
            self._shown_s = part_s
            set_value(self._from, part_s[0])
            set_value(self._to, part_s[1] or 0.0)

    def _press(self, label: str) -> None:
        here_s = self._playback.state.position_s
        actions: dict[str, Callable[[], object]] = {
            _BEGIN: partial(begin_at, self._playback, here_s),
            _END: partial(end_at, self._playback, here_s),
            _NONE: self._playback.set_part,
        }
        actions[label]()
        self.refresh()

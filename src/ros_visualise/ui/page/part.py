"""The marks between which is played."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import viser

from ros_visualise.sources.playback import Playback
from ros_visualise.ui.page.controls import set_value
from ros_visualise.ui.page.scripts import add_channel
from ros_visualise.ui.page.worker import Worker

_BEGIN, _END, _NONE = "[ here", "here ]", "none"


class Part:
    """A folder with both marks, as numbers and as buttons; the keys [ and ] set them too.

    The part that begins or ends with the recording has no mark there: that is a zero.
    """

    def __init__(self, gui: viser.GuiApi, playback: Playback, worker: Worker) -> None:
        self._playback = playback
        begin_s, end_s = self._shown_s = playback.state.part_s
        with gui.add_folder("part", expand_by_default=False):
            self._from = gui.add_number(
                "from", begin_s, min=0.0, step=0.01, hint="seconds; the key [ sets it"
            )
            self._to = gui.add_number(
                "to",
                end_s or 0.0,
                min=0.0,
                step=0.01,
                hint="seconds, 0: the end; the key ] sets it",
            )
            buttons = gui.add_button_group("marks", (_BEGIN, _END, _NONE))
        self._from.on_update(worker.listener("part from", self._begin_at))
        self._to.on_update(worker.listener("part to", self._end_at))
        buttons.on_click(worker.listener(None, self._press))
        add_channel(gui, worker, "mark", lambda key, _: self._press({"[": _BEGIN}.get(key, _END)))

    def refresh(self) -> None:
        """Show where they are now."""
        part_s = self._playback.state.part_s
        if part_s != self._shown_s:  # else it would undo what a person sets just now
            self._shown_s = part_s
            set_value(self._from, part_s[0])
            set_value(self._to, part_s[1] or 0.0)

    def _press(self, label: str) -> None:
        here_s = self._playback.state.position_s
        actions: dict[str, Callable[[], object]] = {
            _BEGIN: partial(self._begin_at, here_s),
            _END: partial(self._end_at, here_s),
            _NONE: self._playback.set_part,
        }
        actions[label]()
        self.refresh()

    def _begin_at(self, time_s: float) -> None:
        """Begin there; an end that comes before is none any more."""
        end_s = self._playback.state.part_s[1]
        self._playback.set_part(time_s, end_s if end_s is not None and end_s > time_s else None)

    def _end_at(self, time_s: float) -> None:
        """End there; a beginning that comes after is none any more."""
        begin_s = self._playback.state.part_s[0]
        self._playback.set_part(begin_s if begin_s < time_s or not time_s else 0.0, time_s or None)

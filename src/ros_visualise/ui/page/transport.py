"""The controls of playback: play, step, seek, rate, loop, and a range to play."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import viser

from ros_visualise.core.rate import MAX_RATE
from ros_visualise.sources.playback import Playback, PlaybackState
from ros_visualise.ui.page.controls import set_value, soon
from ros_visualise.ui.page.scripts import add_channel
from ros_visualise.ui.page.worker import Worker

_BACK, _PAUSE, _PLAY, _STEP = "◂", "❚❚ Pause", "▶ Play", "▸"
_MIN_RATE = 0.1  # one step lower is 0, unlimited
_ANY = "Any message"
_SEEK, _RATE, _LOOP = "seek", "rate", "loop"
_HANDS_OFF_S = 1.0
"""The slider of the time is left alone for so long after a person moved it."""


class PlaybackControls:
    """The elements that drive one playback, in the present container.

    A ``live`` source can be paused but not seeked.
    """

    def __init__(self, gui: viser.GuiApi, playback: Playback, live: bool, worker: Worker) -> None:
        self._gui, self._playback, self._live, self._worker = gui, playback, live, worker
        self._moved_s = -_HANDS_OFF_S
        self._state = playback.state
        self._buttons = gui.add_button_group("Playback", self._options())
        self._buttons.on_click(worker.listener(None, self._press))
        if not live:
            self._add_elements(gui)
        self._add_keys(gui)

    def refresh(self) -> None:
        self._state = self._playback.state
        self._buttons.options = self._options()
        if self._live:
            return
        self._note.content = _describe(self._state)
        self._time.max = max(self._time.max, _end_s(self._state))
        self._show(_RATE, self._rate, _shown_rate(self._state.rate))
        self._show(_LOOP, self._loop, self._state.loop)
        self._range.refresh()
        is_moved = self._worker.is_posted(_SEEK)
        if not is_moved and time.monotonic() - self._moved_s > _HANDS_OFF_S:
            set_value(self._time, round(self._state.position_s, 2))

    def _show(self, key: str, element: viser.GuiInputHandle[Any], value: Any) -> None:
        soon(self._gui, partial(self._show_now, key, element, value))

    def _show_now(self, key: str, element: viser.GuiInputHandle[Any], value: Any) -> None:
        if not self._worker.is_posted(key):  # else the person at it is ahead of us
            set_value(element, value)

    def _options(self) -> tuple[str, ...]:
        middle = _PAUSE if self._state.playing else _PLAY
        return (middle, _STEP) if self._live else (_BACK, middle, _STEP)

    def _add_elements(self, gui: viser.GuiApi) -> None:
        state = self._state
        self._time = gui.add_slider("Time", 0.0, _end_s(state), 0.01, state.position_s)
        self._time.on_update(self._worker.listener(_SEEK, self._seek))
        self._note = gui.add_html(_describe(state))
        self._rate = gui.add_number(
            "Rate",
            _shown_rate(state.rate),
            min=_MIN_RATE,
            max=float(MAX_RATE),
            step=0.1,
            hint="Playback speed; 100 is unlimited",
        )
        self._rate.on_update(self._worker.listener(_RATE, self._playback.set_rate))
        self._loop = gui.add_checkbox("Loop", state.loop, hint="Start over at the end")
        self._loop.on_update(self._worker.listener(_LOOP, self._playback.set_loop))
        if len(self._playback.step_topics) > 1:
            self._add_step_topic(gui)
        self._range = PlaybackRange(gui, self._playback, self._worker)

    def _add_step_topic(self, gui: viser.GuiApi) -> None:
        playback = self._playback
        options = (_ANY, *playback.step_topics)
        hint = "Step to the next message of this topic"
        chosen = gui.add_dropdown(
            "Step by", options, initial_value=playback.step_topic or _ANY, hint=hint
        )
        chosen.on_update(self._worker.listener("step by", self._step_by))

    def _add_keys(self, gui: viser.GuiApi) -> None:
        playback = self._playback
        keys: list[tuple[str, Any, Callable[[], object]]] = [
            ("Play or pause", "space", playback.toggle),
            ("Step forward", "arrowright", playback.step),
        ]
        if not self._live:
            keys.append(("Step back", "arrowleft", partial(playback.step, -1)))
            keys.append(("Go to start", "home", lambda: playback.seek(playback.state.part_s[0])))
        for label, key, action in keys:
            self._worker.add_key(gui, label, key, partial(self._do, action))

    def _press(self, label: str) -> None:
        playback = self._playback
        actions: dict[str, Callable[[], object]] = {
            _BACK: partial(playback.step, -1),
            _PAUSE: playback.pause,
            _PLAY: playback.play,
            _STEP: playback.step,
        }
        self._do(actions[label])

    def _do(self, action: Callable[[], object]) -> None:
        """Do it and show the result at once."""
        action()
        self.refresh()

    def _seek(self, time_s: float) -> None:
        self._moved_s = time.monotonic()
        self._playback.seek(time_s)

    def _step_by(self, topic: str) -> None:
        self._playback.step_topic = "" if topic == _ANY else topic


def _shown_rate(rate: float) -> float:
    """The slider's value of a rate; 0, unlimited, is at its fast end."""
    return max(rate or MAX_RATE, _MIN_RATE)


def _end_s(state: PlaybackState) -> float:
    """The known end, in seconds, rounded up to hundredths."""
    return math.ceil(100 * max(state.duration_s or 0.0, state.position_s, 0.01)) / 100


def _describe(state: PlaybackState) -> str:
    length = "" if state.duration_s is None else f" of {_clock(state.duration_s)}"
    what = "Ended" if state.ended else "Playing" if state.playing else "Paused"
    speed = "unlimited" if state.rate == 0 else f"{state.rate:g} ×"
    return (
        f'<div class="rv-caption">{_clock(state.position_s)}{length}'
        f"<span>{what}, {speed}</span></div>" + _describe_part(*state.part_s)
    )


def _describe_part(begin_s: float, end_s: float | None) -> str:
    if not begin_s and end_s is None:
        return ""
    end = "the end" if end_s is None else _clock(end_s)
    return f'<div class="rv-caption">Range: {_clock(begin_s)} to {end}</div>'


def _clock(seconds: float) -> str:
    minutes, rest = divmod(max(seconds, 0.0), 60)
    return f"{int(minutes)}:{rest:05.2f}"


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
        self._from.on_update(worker.listener("part from", self._begin_at))
        self._to.on_update(worker.listener("part to", self._end_at))
        buttons.on_click(worker.listener(None, self._press))
        add_channel(gui, worker, "mark", lambda key, _: self._press({"[": _BEGIN}.get(key, _END)))

    def refresh(self) -> None:
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
        """Set the start; an earlier end is cleared."""
        end_s = self._playback.state.part_s[1]
        self._playback.set_part(time_s, end_s if end_s is not None and end_s > time_s else None)

    def _end_at(self, time_s: float) -> None:
        """Set the end; a later start is cleared."""
        begin_s = self._playback.state.part_s[0]
        self._playback.set_part(begin_s if begin_s < time_s or not time_s else 0.0, time_s or None)

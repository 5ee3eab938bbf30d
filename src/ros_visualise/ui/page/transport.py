"""The controls of playback: play, step, seek, rate and loop."""

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
from ros_visualise.ui.page.part import Part
from ros_visualise.ui.page.worker import Worker

_BACK, _PAUSE, _PLAY, _STEP = "◂", "❚❚ pause", "▶ play", "▸"
_MIN_RATE = 0.1  # lower by steps, it would be 0: as fast as it goes
_ANY = "any message"
_SEEK, _RATE, _LOOP = "seek", "rate", "loop"
_HANDS_OFF_S = 1.0
"""For so long after a person moved the time, it is not moved under their hand."""


class Transport:
    """The elements that drive one playback, in the present container.

    Args:
        live: the source can be paused, but not sought.
    """

    def __init__(self, gui: viser.GuiApi, playback: Playback, live: bool, worker: Worker) -> None:
        self._gui, self._playback, self._live, self._worker = gui, playback, live, worker
        self._moved_s = -_HANDS_OFF_S
        self._state = playback.state
        self._buttons = gui.add_button_group("playback", self._options())
        self._buttons.on_click(worker.listener(None, self._press))
        if not live:
            self._add_elements(gui)
        self._add_keys(gui)

    def refresh(self) -> None:
        """Show what the playback does now."""
        self._state = self._playback.state
        self._buttons.options = self._options()
        if self._live:
            return
        self._note.content = _describe(self._state)
        self._time.max = max(self._time.max, _end_s(self._state))
        self._show(_RATE, self._rate, _shown_rate(self._state.rate))
        self._show(_LOOP, self._loop, self._state.loop)
        self._part.refresh()
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
        self._time = gui.add_slider("time", 0.0, _end_s(state), 0.01, state.position_s)
        self._time.on_update(self._worker.listener(_SEEK, self._seek))
        self._note = gui.add_html(_describe(state))
        self._rate = gui.add_number(
            "rate",
            _shown_rate(state.rate),
            min=_MIN_RATE,
            max=float(MAX_RATE),
            step=0.1,
            hint="speed of playing",
        )
        self._rate.on_update(self._worker.listener(_RATE, self._playback.set_rate))
        self._loop = gui.add_checkbox("loop", state.loop, hint="start over at the end")
        self._loop.on_update(self._worker.listener(_LOOP, self._playback.set_loop))
        if len(self._playback.step_topics) > 1:
            self._add_step_topic(gui)
        self._part = Part(gui, self._playback, self._worker)

    def _add_step_topic(self, gui: viser.GuiApi) -> None:
        playback = self._playback
        options = (_ANY, *playback.step_topics)
        hint = "a step goes to the next message of this topic"
        chosen = gui.add_dropdown(
            "step by", options, initial_value=playback.step_topic or _ANY, hint=hint
        )
        chosen.on_update(self._worker.listener("step by", self._step_by))

    def _add_keys(self, gui: viser.GuiApi) -> None:
        playback = self._playback
        keys: list[tuple[str, Any, Callable[[], object]]] = [
            ("Play or pause", "space", playback.toggle),
            ("One image forward", "arrowright", playback.step),
        ]
        if not self._live:
            keys.append(("One image back", "arrowleft", partial(playback.step, -1)))
            keys.append(("To the start", "home", lambda: playback.seek(playback.state.part_s[0])))
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
        """Do it, and show the result at once."""
        action()
        self.refresh()

    def _seek(self, time_s: float) -> None:
        self._moved_s = time.monotonic()
        self._playback.seek(time_s)

    def _step_by(self, topic: str) -> None:
        self._playback.step_topic = "" if topic == _ANY else topic


def _shown_rate(rate: float) -> float:
    """The slider's value of a rate: 0 (as fast as possible) is at its fast end."""
    return max(rate or MAX_RATE, _MIN_RATE)


def _end_s(state: PlaybackState) -> float:
    """The end, as far as it is known, in hundredths of a second."""
    return math.ceil(100 * max(state.duration_s or 0.0, state.position_s, 0.01)) / 100


def _describe(state: PlaybackState) -> str:
    length = "" if state.duration_s is None else f" of {_clock(state.duration_s)}"
    what = "at its end" if state.ended else "playing" if state.playing else "paused"
    speed = "as fast as it goes" if state.rate == 0 else f"{state.rate:g} ×"
    return (
        f'<div class="rv-caption">{_clock(state.position_s)}{length}'
        f"<span>{what}, {speed}</span></div>" + _describe_part(*state.part_s)
    )


def _describe_part(begin_s: float, end_s: float | None) -> str:
    if not begin_s and end_s is None:
        return ""
    end = "the end" if end_s is None else _clock(end_s)
    return f'<div class="rv-caption">[ {_clock(begin_s)} to {end} ]</div>'


def _clock(seconds: float) -> str:
    minutes, rest = divmod(max(seconds, 0.0), 60)
    return f"{int(minutes)}:{rest:05.2f}"

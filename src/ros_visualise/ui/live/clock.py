"""The clock of the page: one playback, which all browsers show and drive."""

from __future__ import annotations

import asyncio
import json
import logging
import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.runtime.base import Runtime
from ros_visualise.sources.playback import Playback
from ros_visualise.ui.live.exchange import exchange, ignore
from ros_visualise.ui.live.marks import Marks
from ros_visualise.ui.live.played import PlaybackLine, playback_line
from ros_visualise.ui.live.rewinding import Rewinder
from ros_visualise.ui.server.gate import Receive, Scope, Send, Visit
from ros_visualise.ui.server.host import page_loop
from ros_visualise.ui.server.pool import Pool

log = logging.getLogger(__name__)

_PERIOD_S, _PLAYING_S = 0.03, 0.09
_FARTHEST_S = 1e9
_RATES = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
_OF_LIVE, _OF_PAST = ("toggle", "step"), ("toggle", "step", "rate")
_FLOWING = ("position", "duration", "begin", "stamp", "megabytes")


class PageClock:
    """Sends browsers the state of a playback with its marks, and does what they ask.

    Attributes:
        marks: of what is played.
    """

    path = "/live/clock"

    def __init__(self) -> None:
        self._playback: Playback | None = None
        self._player = ""
        self._line: PlaybackLine | None = None
        self._rewinder: Rewinder | None = None
        self._browsers = 0
        self.marks = Marks()
        self._writing = Pool("marks", 1)
        self._actions: Mapping[str, Callable[[Playback, Any], None]] = {
            "toggle": lambda playback, _: playback.toggle(),
            "step": lambda playback, forward: playback.step(1 if forward else -1),
            "seek": lambda playback, to: playback.seek(seconds_of(to)),
            "skip": lambda playback, by: playback.seek(seconds_of(playback.state.position_s + by)),
            "rate": lambda playback, rate: playback.set_rate(float(rate)),
            "faster": _change_rate,
            "loop": _loop,
            "topic": _step_by,
            "begin": lambda playback, _: begin_at(playback, playback.state.position_s),
            "end": lambda playback, _: end_at(playback, playback.state.position_s),
            "begin_at": lambda playback, to: begin_at(playback, seconds_of(to)),
            "end_at": lambda playback, to: end_at(playback, seconds_of(to)),
            "whole": lambda playback, _: playback.set_part(),
            "range": lambda playback, ends: playback.set_part(*_part_s(ends)),
            "repeat": lambda playback, ends: playback.repeat(*_part_s(ends)),
            "mark": self._mark,
        }

    @property
    def is_watched(self) -> bool:
        """True while a browser shows it."""
        return self._browsers > 0

    def show(self, runtime: Runtime | None) -> None:
        """Show the playback of this graph, if it has one; one that is live can be rewound."""
        self._rewinder = runtime if isinstance(runtime, Rewinder) else None
        self._playback = None if runtime is None else runtime.playback
        source = None if runtime is None else runtime.graph.source
        self._player = "" if source is None else source.name
        self._line = None if runtime is None else playback_line(runtime.graph, self._playback)

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one browser until it leaves: it sends ``{ACTION: VALUE}``."""
        visit: Visit = scope["state"]["visit"]
        hear = ignore if visit.is_viewer else self.act
        self._browsers += 1
        try:
            await exchange(receive, send, self._send_all(send), hear)
        finally:
            self._browsers -= 1

    def close(self) -> None:
        """End the thread that writes marks."""
        self._writing.close()

    def act(self, text: str) -> None:
        """Do what a browser asks; anything else than our pages ask is ignored."""
        try:
            asked = json.loads(text)
            (action, value), *_ = asked.items()
            if self._rewinder is not None:
                self._act_live(self._rewinder, action, value)
            elif self._playback is not None:
                self._actions[action](self._playback, value)
        except RosVisualiseError as error:
            log.warning("%s", error)
        except (AttributeError, KeyError, TypeError, ValueError, RecursionError, OverflowError):
            return

    def _act_live(self, rewinder: Rewinder, action: str, value: Any) -> None:
        """Do what a browser asks of a live source: pause it, or show what is kept of it."""
        past = rewinder.past  # it may end meanwhile
        if action == "seek":
            rewinder.seek(seconds_of(value))
        elif action == "skip":
            place_s = rewinder.now_s if past is None else past.state.position_s
            rewinder.seek(max(seconds_of(place_s + value), rewinder.buffer.begin_ns / 1e9))
        elif action == "live":
            rewinder.leave_past()
        elif past is not None and action in _OF_PAST:
            self._actions[action](past, value)
        elif self._playback is not None and action in _OF_LIVE:
            self._actions[action](self._playback, value)
        elif action == "toggle":
            rewinder.seek(rewinder.now_s, paused=True)

    def _mark(self, playback: Playback, mark: Any) -> None:
        """Set the mark at a time to a name, or one at the present time, for which ``None`` stands.

        A mark at the present time without a name gets the next free one.
        """
        at, name = mark
        if not isinstance(name, str):
            raise ValueError(name)
        at_s = playback.state.position_s if at is None else seconds_of(at)
        at_s = max(at_s - playback.lead_s, 0.0)  # they are those of the first source
        is_new = at is None and not name
        write = partial(self.marks.add, at_s) if is_new else partial(self.marks.set, at_s, name)
        writing = self._write(write)
        asyncio.run_coroutine_threadsafe(writing, page_loop())

    async def _write(self, write: Callable[[], None]) -> None:
        try:
            await self._writing.do(write)
        except RosVisualiseError as error:
            log.warning("%s", error)

    async def _send_all(self, send: Send) -> None:
        """Send the state as soon as it changes; the place of what plays a few times a second."""
        shown: Mapping[str, Any] | None = None
        shown_s, now_s = -math.inf, asyncio.get_running_loop().time
        while True:
            state = self.state
            is_play = bool(state.get("playing")) and _but_position(state) == _but_position(shown)
            if state != shown and (not is_play or now_s() - shown_s > _PLAYING_S):
                shown, shown_s = state, now_s()
                await send({"type": "websocket.send", "text": json.dumps(state)})
            await asyncio.sleep(_PERIOD_S)

    @property
    def state(self) -> Mapping[str, Any]:
        """The state of the playback as browsers show it; empty without one."""
        if self._rewinder is not None:
            return _live_state(self._rewinder)
        playback = self._playback
        if playback is None:
            return {}
        state = playback.state
        return {
            "position": state.position_s,
            "duration": state.duration_s,
            "start": self._start_s,
            "playing": state.playing,
            "ended": state.ended,
            "rate": state.rate,
            "rates": _RATES,
            "loop": state.loop,
            "part": state.part_s,
            "first_part": playback.first_part_s,
            "topics": playback.step_topics,
            "topic": playback.step_topic,
            "live": False,
            "marks": [(at_s + playback.lead_s, name) for at_s, name in self.marks.names.items()],
            "player": self._player,
            "sources": [one._asdict() for one in playback.sources],
        }

    @property
    def _start_s(self) -> float | None:
        """The stamp of the start of what is played, once it has begun."""
        has_begun = self._line is not None and self._line.playback.has_played
        return self._line.time_ns(0) / 1e9 if self._line and has_begun else None


def _live_state(rewinder: Rewinder) -> Mapping[str, Any]:
    """The state of a live source as browsers show it."""
    past, source, buffer = rewinder.past, rewinder.playback, rewinder.buffer
    now_s = rewinder.now_s
    shown = past if past is not None else source
    return {
        "position": now_s if past is None else past.state.position_s,
        "duration": now_s,
        "begin": buffer.begin_ns / 1e9,
        "playing": shown is None or shown.state.playing,
        "rate": 1.0 if past is None else past.state.rate,
        "live": True,
        "past": past is not None,
        "stamp": rewinder.stamp_ns / 1e9,
        "megabytes": [round(buffer.nbytes / 1e6), round(buffer.most_bytes / 1e6)],
    }


def _but_position(state: Mapping[str, Any] | None) -> Mapping[str, Any]:
    return {name: value for name, value in (state or {}).items() if name not in _FLOWING}


def begin_at(playback: Playback, time_s: float) -> None:
    """Set the start of the range that is played; an earlier end is cleared."""
    end_s = playback.state.part_s[1]
    playback.set_part(time_s, end_s if end_s is not None and end_s > time_s else None)


def end_at(playback: Playback, time_s: float) -> None:
    """Set the end of the range that is played; a later start is cleared. 0 is the recording's."""
    begin_s = playback.state.part_s[0]
    playback.set_part(begin_s if begin_s < time_s or not time_s else 0.0, time_s or None)


def _part_s(ends: Any) -> tuple[float, float | None]:
    begin, end = ends
    return seconds_of(begin), None if end is None else seconds_of(end)


def seconds_of(value: Any) -> float:
    """A time in a recording; raises ValueError or TypeError for anything else."""
    if isinstance(value, bool) or not math.isfinite(value):
        raise ValueError(f"{value!r} is not a time")
    return float(min(max(value, 0.0), _FARTHEST_S))


def _change_rate(playback: Playback, faster: Any) -> None:
    """Take the next speed up or down; without a limit, the fastest."""
    rate = playback.state.rate or math.inf
    if faster is True:
        playback.set_rate(min((one for one in _RATES if one > rate), default=_RATES[-1]))
    else:
        playback.set_rate(max((one for one in _RATES if one < rate), default=_RATES[0]))


def _loop(playback: Playback, loop: Any) -> None:
    """Set whether playback loops; ``None`` changes that."""
    playback.set_loop(not playback.state.loop if loop is None else loop is True)


def _step_by(playback: Playback, topic: Any) -> None:
    if topic == "" or topic in playback.step_topics:
        playback.step_topic = topic

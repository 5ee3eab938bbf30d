"""A robot's panel: its status, its commands, and driving it by buttons and keys that are held."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable, Collection, Mapping
from html import escape
from typing import NamedTuple

import numpy as np
import viser

from ros_visualise.data import Twist
from ros_visualise.graph import Graph
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.feed import Feed
from ros_visualise.ui.page.controls import sentence
from ros_visualise.ui.page.scripts import add_channel
from ros_visualise.ui.page.worker import Worker
from ros_visualise.ui.shown import robot_status

log = logging.getLogger(__name__)

_STOP = "stop"
_LAPSE_S = 0.4
"""A browser that is silent for so long holds nothing any more."""


class _Move(NamedTuple):
    axis: str
    label: str
    key: str
    share: tuple[float, float, float, float]
    """x, y, z and rotation, as shares of the speeds."""


_MOVES: Mapping[str, _Move] = {
    "left": _Move("angular.z", "◀ Left", "j", (0, 0, 0, 1)),
    "forward": _Move("linear.x", "▲ Forward", "i", (1, 0, 0, 0)),
    "right": _Move("angular.z", "▶ Right", "l", (0, 0, 0, -1)),
    "up": _Move("linear.z", "△ Up", "t", (0, 0, 1, 0)),
    "back": _Move("linear.x", "▼ Back", "m", (-1, 0, 0, 0)),
    "down": _Move("linear.z", "▽ Down", "b", (0, 0, -1, 0)),
}


class _Hold(NamedTuple):
    press: str
    moves: tuple[_Move, ...]
    heard_s: float


class Driving:
    """Buttons and keys that move a robot while they are held.

    The browser repeats what is held (``scripts/hold.js``). The robot stops when that is released,
    and when the browser falls silent: by a lost connection, or because it hangs. A press that ended
    so moves nothing when it is heard again; it takes a new one.

    The ``worker`` serves these buttons alone, so that a stop never waits.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        folder: viser.GuiFolderHandle,
        runtime: Runtime,
        worker: Worker,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._runtime, self._clock = runtime, clock
        self._topic = velocity_topic(runtime.graph)
        self._held: _Hold | None = None
        self._ended: deque[str] = deque(maxlen=100)  # presses
        folder.visible = self._topic is not None
        if self._topic is None:
            return
        axes = _velocity_axes(runtime.graph, self._topic)
        self._moves = {name: move for name, move in _MOVES.items() if move.axis in axes}
        with folder:
            self._speed = gui.add_slider("Speed", 0.1, 3.0, 0.1, 0.8, hint="m/s")
            self._turn = gui.add_slider("Turn speed", 0.1, 2.0, 0.1, 0.6, hint="rad/s")
            gui.add_html(_pad(self._moves))
            add_channel(gui, worker, "hold", self._hear)
        worker.add_key(gui, "Stop driving", "k", self._stop)

    def refresh(self) -> None:
        """Repeat the velocity: without it a robot stops by itself."""
        if self._held is None or self._topic is None:
            return
        if self._clock() - self._held.heard_s > _LAPSE_S:
            log.warning("Stopped: lost contact with the browser for %g s. Press again.", _LAPSE_S)
            self._stop()
            return
        shares = np.sum([move.share for move in self._held.moves], axis=0)
        linear, turn = self._speed.value * shares[:3], self._turn.value * shares[3]
        self._runtime.publish(self._topic, Twist(linear, np.array([0.0, 0.0, turn])))

    def make_way(self, node: str) -> None:
        """Stop driving for an action of the robot itself."""
        graph = self._runtime.graph
        if self._topic is not None and self._topic in graph.node(node).inputs.values():
            self._stop()

    def _hear(self, text: str, _: int) -> None:
        """Handle a browser's ``PRESS NUMBER NAME ...``, without names when released."""
        press, *names = text.split() or [""]
        if _STOP in names:
            self._ended.append(press)
            self._stop()
        elif press not in self._ended and (self._held is None or self._held.press == press):
            moves = tuple(self._moves[name] for name in names if name in self._moves)
            self._hold(_Hold(press, moves, self._clock()))

    def _hold(self, hold: _Hold) -> None:
        if hold.moves:
            self._held = hold
            self.refresh()
        else:
            self._stop()

    def _stop(self) -> None:
        if self._held is not None and self._topic is not None:
            self._ended.append(self._held.press)
            self._held = None
            self._runtime.publish(self._topic, Twist(np.zeros(3), np.zeros(3)))


def _pad(moves: Mapping[str, _Move]) -> str:
    """The buttons, as a table of three columns, and a wide one that stops."""
    cells = [
        f'<button data-hold="{name}" data-key="{move.key}">{move.label}'
        f"<kbd>{move.key.upper()}</kbd></button>"
        if name in moves
        else "<i></i>"
        for name, move in _MOVES.items()
    ]
    stop = f'<button data-hold="{_STOP}">■ Stop<kbd>K</kbd></button>'
    note = '<div class="rv-note">Hold a button or its key to drive.</div>'
    return f'<div class="rv-pad">{"".join(cells)}{stop}</div>{note}'


def velocity_topic(graph: Graph) -> str | None:
    """The topic of velocities that a robot of this graph follows, or None."""
    return next((topic for topic, kind in graph.inputs.items() if kind is Twist), None)


def _velocity_axes(graph: Graph, topic: str) -> Collection[str]:
    """The axes along which the robot on a topic moves; all of them if undeclared."""
    source = graph.source
    if source is not None and topic in source.inputs.values():
        return source.type.velocity_axes
    return {move.axis for move in _MOVES.values()}


_FAILED = "failed"


class RobotStatus:
    """A line with the robot's status, and a button for each of its actions.

    ``act`` is called with the node and the action.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        folder: viser.GuiFolderHandle,
        runtime: Runtime,
        worker: Worker,
        act: Callable[[str, str], None],
    ) -> None:
        robot, topic = robot_status(runtime.graph)
        self._feed = Feed(runtime)
        self._feed.follow(topic)
        if robot is None:
            return
        actions = {sentence(name): name for name in robot.type.actions}
        with folder:
            self._line = gui.add_html("", visible=False)
            if actions:
                buttons = gui.add_button_group("Commands", tuple(actions))
                act_on = robot.name
                buttons.on_click(worker.listener(None, lambda label: act(act_on, actions[label])))

    def refresh(self) -> None:
        status = self._feed.take()
        if status is not None:
            kind = "rv-status rv-failed" if status.text.startswith(_FAILED) else "rv-status"
            self._line.content = f'<div class="{kind}">{escape(status.text)}</div>'
            self._line.visible = True

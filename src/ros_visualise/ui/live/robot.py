"""A robot for browsers: its status, its actions, and driving it by what is held."""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import Callable, Collection, Sequence
from functools import partial
from typing import Annotated, NamedTuple

import msgspec
import numpy as np
from msgspec import Meta

from ros_visualise.data import Twist
from ros_visualise.graph import Graph
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.feed import Feed
from ros_visualise.ui.live.asked import Asked, Name, understand
from ros_visualise.ui.live.board import LiveBoard, Visitor
from ros_visualise.ui.live.declared import actions_of
from ros_visualise.ui.live.exchange import ignore
from ros_visualise.ui.server.gate import Receive, Scope, Send, Visit
from ros_visualise.ui.shown import robot_status
from ros_visualise.ui.worker import PageWorker

log = logging.getLogger(__name__)

_LAPSE_S = 0.4
"""A browser that is silent for so long holds nothing any more."""
_DRIVE_S, _WATCH_S, _CLOSE_S = 0.05, 0.2, 0.3
_FAILED = "failed"


class Move(NamedTuple):
    """A button: the axis that it moves along, its key, and shares of the speeds.

    The shares are of x, y, z and rotation.
    """

    axis: str
    label: str
    key: str
    share: tuple[float, float, float, float]


MOVES = {
    "left": Move("angular.z", "◀ Left", "j", (0, 0, 0, 1)),
    "forward": Move("linear.x", "▲ Forward", "i", (1, 0, 0, 0)),
    "right": Move("angular.z", "▶ Right", "l", (0, 0, 0, -1)),
    "up": Move("linear.z", "△ Up", "t", (0, 0, 1, 0)),
    "back": Move("linear.x", "▼ Back", "m", (-1, 0, 0, 0)),
    "down": Move("linear.z", "▽ Down", "b", (0, 0, -1, 0)),
}


class Hold(Asked, tag="hold"):
    """Names of what is held, without any when it is released; repeated while it is held."""

    press: Name
    names: Annotated[list[Name], Meta(max_length=20)]
    speed: Annotated[float, Meta(ge=0, le=3.0)] = 0.8
    turn: Annotated[float, Meta(ge=0, le=2.0)] = 0.6


class StopDriving(Asked, tag="stop"):
    """Stop the robot, also for another browser; the given press moves nothing any more."""

    press: Name = ""


class RobotAct(Asked, tag="act"):
    """Do an action of the robot."""

    action: Name


_DECODER = msgspec.json.Decoder(Hold | StopDriving | RobotAct)


class _HeldPress(NamedTuple):
    press: str
    visitor: Visitor
    velocity: Twist
    heard_s: float


class Driving:
    """Moves a robot while browsers say that something is held; all on one thread.

    The robot stops when that is released, and when the browser leaves or falls silent: by a lost
    connection, or because it hangs. A press that ended so moves nothing when it is heard again; it
    takes a new one.
    """

    def __init__(self, runtime: Runtime, clock: Callable[[], float] = time.monotonic) -> None:
        self._runtime, self._clock = runtime, clock
        self.graph = runtime.graph
        self.topic = velocity_topic(self.graph)
        axes = _velocity_axes(self.graph, self.topic) if self.topic else ()
        self.moves = {name: move for name, move in MOVES.items() if move.axis in axes}
        self._held: _HeldPress | None = None
        self._ended: deque[str] = deque(maxlen=100)  # presses

    def refresh(self) -> None:
        """Repeat the velocity: without it a robot stops by itself."""
        if self._held is None:
            return
        if self._clock() - self._held.heard_s > _LAPSE_S:
            log.warning("Stopped: lost contact with the browser for %g s. Press again.", _LAPSE_S)
            self.stop()
            return
        self._publish(self._held.velocity)

    def hear(self, visitor: Visitor, hold: Hold) -> None:
        """Handle what a browser holds; while another press is held, nothing."""
        is_other = self._held is not None and self._held.press != hold.press
        if is_other or hold.press in self._ended:
            return
        shares = [self.moves[name].share for name in set(hold.names) & self.moves.keys()]
        if shares:
            velocity = _velocity(shares, hold.speed, hold.turn)
            self._held = _HeldPress(hold.press, visitor, velocity, self._clock())
            self.refresh()
        else:
            self.stop()

    def leave(self, visitor: Visitor) -> None:
        """Stop what a browser holds that has left."""
        if self._held is not None and self._held.visitor is visitor:
            self.stop()

    def make_way(self, node: str) -> None:
        """Stop driving for an action of the robot itself."""
        if any(m.name == node and self.topic in m.inputs.values() for m in self.graph.members):
            self.stop()

    def stop(self, press: str = "") -> None:
        """Stop what moves; a press that is given moves nothing any more."""
        self._ended.append(press)
        if self._held is not None:
            self._ended.append(self._held.press)
            self._held = None
            self._publish(Twist(np.zeros(3), np.zeros(3)))

    def _publish(self, velocity: Twist) -> None:
        if self.topic is not None:
            self._runtime.publish(self.topic, velocity)


def _velocity(shares: Sequence[tuple[float, ...]], speed: float, turn: float) -> Twist:
    total = np.sum(shares, axis=0)
    return Twist(speed * total[:3], np.array([0.0, 0.0, turn * total[3]]))


def velocity_topic(graph: Graph) -> str | None:
    """The topic of velocities that a robot of this graph follows, or None."""
    return next((topic for topic, kind in graph.inputs.items() if kind is Twist), None)


def _velocity_axes(graph: Graph, topic: str) -> Collection[str]:
    """The axes along which the robot on a topic moves; all of them if undeclared."""
    source = graph.source
    if source is not None and topic in source.inputs.values():
        return source.type.velocity_axes
    return {move.axis for move in MOVES.values()}


class RobotHub:
    """Serves the robot of a graph to all browsers, and does what they ask.

    Args:
        say: called with the reason of a rejection, one line.
    """

    path = "/live/robot"

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        say: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._board, self._say, self._clock = LiveBoard(loop), say, clock
        self._runtime: Runtime | None = None
        self._driving: Driving | None = None
        self._feed: Feed | None = None
        self._actors: dict[str, PageWorker] = {}  # node -> who does its actions
        self._driver = PageWorker(
            say, self._drive, _DRIVE_S
        )  # for nothing else: a stop never waits
        self._watcher = PageWorker(say, self._watch, _WATCH_S)

    def show(self, runtime: Runtime | None) -> None:
        """Show the robot of this runtime from now on, or none; from any thread."""
        self._runtime = runtime
        self._driver.post("follow", self._follow)
        self._watcher.post("feed", self._feed_anew)
        for worker in (self._driver, self._watcher):
            worker.start()

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one browser until it leaves: it sends requests, and gets lists of messages."""
        visit: Visit = scope["state"]["visit"]
        visitor = Visitor()
        hear = ignore if visit.is_viewer else partial(self._hear, visitor)
        try:
            await self._board.serve(receive, send, visitor, hear)
        finally:
            self._driver.post(visitor, partial(self._leave, visitor))

    def act(self, node: str, action: str) -> None:
        """Do an action on its node's own thread, so that driving and other nodes need not wait."""
        self._driver.post(object(), partial(self._begin, node, action))

    def close(self) -> None:
        """End all threads."""
        for worker in (self._driver, self._watcher, *self._actors.values()):
            worker.close(_CLOSE_S)
        self._feed_anew()

    def _hear(self, visitor: Visitor, text: str) -> None:
        request = understand(_DECODER, text)
        if isinstance(request, Hold):
            do = self._driver.ask if request.names else self._driver.post
            do((visitor, request.press), partial(self._hold, visitor, request))
        elif isinstance(request, StopDriving):
            self._driver.post(StopDriving, partial(self._stop, request.press))
        elif isinstance(request, RobotAct):
            self._watcher.ask(object(), partial(self._ask, request.action))

    def _hold(self, visitor: Visitor, request: Hold) -> None:
        if self._driving is not None:
            self._driving.hear(visitor, request)

    def _leave(self, visitor: Visitor) -> None:
        if self._driving is not None:
            self._driving.leave(visitor)

    def _stop(self, press: str) -> None:
        if self._driving is not None:
            self._driving.stop(press)

    def _drive(self) -> None:
        """Keep moving what is held, in the present graph."""
        if self._runtime is not None and self._driving is not None:
            graph = self._runtime.graph
            if velocity_topic(graph) != self._driving.topic:
                self._follow()
            self._driving.graph = graph
            self._driving.refresh()

    def _follow(self) -> None:
        """Drive in the present graph, and end the threads of nodes that have left it."""
        if self._driving is not None:
            self._driving.stop()
        runtime = self._runtime
        self._driving = None if runtime is None else Driving(runtime, self._clock)
        there = set() if runtime is None else {node.name for node in runtime.graph.members}
        for name in self._actors.keys() - there:
            self._actors.pop(name).close(0)

    def _begin(self, node: str, action: str) -> None:
        if self._runtime is None or self._driving is None:
            return
        self._driving.make_way(node)
        if node not in self._actors:
            self._actors[node] = PageWorker(self._say, lambda: None, _WATCH_S)
            self._actors[node].start()
        self._actors[node].post(object(), partial(self._runtime.act, node, action))

    def _ask(self, action: str) -> None:
        """Do an action of the robot, if it has that."""
        robot = None if self._runtime is None else robot_status(self._runtime.graph)[0]
        if robot is not None and action in robot.type.actions:
            self.act(robot.name, action)

    def _feed_anew(self) -> None:
        if self._feed is not None:
            self._feed.follow(None)
        self._feed = None if self._runtime is None else Feed(self._runtime)

    def _watch(self) -> None:
        """Show the robot and its status to those who look."""
        if self._feed is None or self._runtime is None or not self._board.is_watched:
            return
        robot, topic = robot_status(self._runtime.graph)
        driving = self._driving
        moves = {} if driving is None else driving.moves
        buttons = [{"name": n, "label": m.label, "key": m.key} for n, m in moves.items()]
        actions = [] if robot is None else actions_of(robot)
        name = "" if robot is None else robot.name
        self._board.put("robot", {"robot": name, "actions": actions, "moves": buttons})
        if self._feed.follow(topic):
            self._board.put("status", {"status": "", "failed": False})
        status = self._feed.take()
        if status is not None:
            failed = status.text.startswith(_FAILED)
            self._board.put("status", {"status": status.text, "failed": failed})

"""The nodes of a graph for browsers: parameters, presets, actions and texts."""

from __future__ import annotations

import asyncio
import json
import logging
import secrets
import threading
from collections.abc import Callable, Mapping
from functools import partial
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct

from ros_visualise.core.errors import ParameterError, RosVisualiseError, UsageError
from ros_visualise.core.params import Parameters, Spec
from ros_visualise.data import Text
from ros_visualise.graph import Graph, Member
from ros_visualise.graph.presets import NAMES, chosen, preset
from ros_visualise.lessons.prose import to_html
from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.saving import live_parameters
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import Value
from ros_visualise.ui.feed import Feed
from ros_visualise.ui.live.asked import Asked, Given, Name, Whole, check_type, understand
from ros_visualise.ui.live.board import LiveBoard, Visitor
from ros_visualise.ui.live.declared import actions_of, declaration, sent
from ros_visualise.ui.live.notices import Notices
from ros_visualise.ui.live.played_range import changed_range, restore_range
from ros_visualise.ui.live.settings import Settings, by_name, shown_specs
from ros_visualise.ui.server.gate import Receive, Scope, Send, Visit
from ros_visualise.ui.shown import texts_of
from ros_visualise.ui.worker import PageWorker

_PERIOD_S = 0.1
_CLOSE_S = 0.3
_MOST = 200


Values = Annotated[dict[Name, Given], Meta(max_length=_MOST)]


class Set(Asked, tag="set"):
    """Set parameters of nodes, each node as one whole."""

    values: Annotated[dict[Name, Values], Meta(max_length=_MOST)]
    number: Whole = 0


class Reset(Asked, tag="reset"):
    """Set a parameter, or without a name all of a node, to how they began."""

    node: Name
    name: Name = ""
    number: Whole = 0


class Preset(Asked, tag="preset"):
    """Set the parameters of a preset."""

    name: Name
    number: Whole = 0


class NodeAct(Asked, tag="act"):
    """Do an action of a node."""

    node: Name
    action: Name


class Restore(Asked, tag="restore"):
    """Set values by their places, as an address has them; see `Settings`."""

    values: Values
    number: Whole = 0


_Change = Set | Reset | Preset | Restore


class Read(Asked, tag="read"):
    """Send the texts of these topics, and of no others."""

    topics: Annotated[list[Name], Meta(max_length=_MOST)]


class _Numbered(Struct):
    """The number of any request, also of an invalid one."""

    number: Whole = 0


_DECODER = msgspec.json.Decoder(_Change | NodeAct | Read)
_NUMBER = msgspec.json.Decoder(_Numbered)


class NodesHub:
    """Serves the parameters of the nodes to all browsers, and does what they ask.

    Attributes:
        settings: the values that differ from how they began.
        restored: called with all settings of an address, by their places today.

    Args:
        notices: where rejections are noted.
        act: called with a node and its action.
        wanted: settings to begin with; see `Settings`.
    """

    path = "/live/nodes"

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        notices: Notices,
        act: Callable[[str, str], None],
        wanted: Mapping[str, Value],
    ) -> None:
        self._notices = notices
        self.settings = Settings(wanted)
        self.restored: Callable[[Mapping[str, Value]], None] = lambda _: None
        self._board = LiveBoard(loop)
        self._run = secrets.token_hex(8)  # by which browsers know the same program
        self._act = act
        self._runtime: Runtime | None = None
        self._graph: Graph | None = None
        self._forget: list[Callable[[], None]] = []
        self._reading: dict[Visitor, frozenset[str]] = {}
        self._feeds: dict[str, Feed] = {}
        self._following = threading.RLock()
        self._worker = PageWorker(self._notices.note, self._tick, _PERIOD_S)
        logging.getLogger("ros_visualise").addHandler(self._notices)

    def show(self, runtime: Runtime | None) -> None:
        """Show the graph of this runtime from now on; with None, the last one stays in view."""
        with self._following:
            self._rest()
            self._runtime = runtime
            if runtime is not None:
                self._follow()
        self._worker.start()

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one browser until it leaves: it sends requests, and gets lists of messages."""
        visit: Visit = scope["state"]["visit"]
        visitor = Visitor()
        try:
            visitor.put("you", json.dumps({"readOnly": visit.is_viewer}))
            hear = partial(self._hear, visitor, visit.is_viewer)
            await self._board.serve(receive, send, visitor, hear)
        finally:
            self._reading.pop(visitor, None)

    def close(self) -> None:
        """End following the graph."""
        logging.getLogger("ros_visualise").removeHandler(self._notices)
        self._worker.close(_CLOSE_S)
        self.show(None)

    @property
    def saved(self) -> dict[str, Value]:
        """The values that differ from how they began, by their places."""
        playback = self._playback
        return ({} if playback is None else changed_range(playback)) | {
            f"{node}/{name}": value
            for node, parameters in self._nodes.items()
            for name, value in self.settings.changed(node, parameters).items()
        }

    def _hear(self, visitor: Visitor, is_viewer: bool, text: str) -> None:
        request = understand(_DECODER, text)
        if isinstance(request, Read):
            self._reading[visitor] = frozenset(request.topics)
        elif is_viewer:
            return
        elif request is None:
            self._refuse(visitor, understand(_NUMBER, text), "a value is invalid: nothing was set")
        elif isinstance(request, NodeAct):
            self._worker.ask(object(), partial(self._begin, request))
        else:
            key = visitor, _key(request)
            if not self._worker.ask(key, partial(self._set, visitor, request)):
                self._refuse(visitor, request, "too many changes are waiting: try again")

    def _set(self, visitor: Visitor, request: _Change) -> None:
        """Set parameters, and answer, after their values, with what changed or was rejected."""
        after: dict[str, Mapping[str, Any]] = {}
        reason = "internal error; see the log"
        try:
            reason = self._change(request, after)
            for node in after:
                self._show(node)
        finally:  # browsers wait for it
            self._answer(visitor, request.number, reason, after)

    def _change(self, request: _Change, after: dict[str, Mapping[str, Any]]) -> str:
        """Set parameters, and put what has changed into ``after``; the reason of a rejection."""
        try:
            for node, values in self._wanted(request).items():
                old = self._of(node)
                self._update(node, values)
                new = self._of(node)
                after[node] = {n: value for n, value in new.items() if old.get(n) != value}
        except RosVisualiseError as error:
            self._notices.note(str(error))
            return str(error)
        return ""

    def _refuse(self, visitor: Visitor, request: _Change | _Numbered | None, reason: str) -> None:
        """Answer a request that is not carried out, if it has a number."""
        if request is not None and request.number:
            self._notices.note(reason)
            self._answer(visitor, request.number, reason, {})

    def _answer(
        self, visitor: Visitor, number: int, reason: str, after: Mapping[str, Mapping[str, Any]]
    ) -> None:
        answer = {"done": number, "reason": reason, "after": after}
        self._board.tell(visitor, f"done/{number}", answer)

    def _wanted(self, request: _Change) -> Mapping[str, Mapping[str, Any]]:
        """The values that a request sets.

        Raises:
            UsageError: an unknown node or preset, or one that does not fit the graph.
            ParameterError: an unknown parameter, or a value of another type.
        """
        if isinstance(request, Restore):
            self.settings.want(request.values)
            self._restore()
            self.restored(by_name(request.values))
            return {}
        if isinstance(request, Preset):
            return {} if self._graph is None else preset(request.name, self._graph)
        if isinstance(request, Reset):
            first = self.settings.first(request.node)
            return {request.node: {n: v for n, v in first.items() if request.name in ("", n)}}
        for node, values in request.values.items():
            declared = {spec.name: spec for spec in self._specs(node)}
            for name, value in values.items():
                if name not in declared:
                    raise ParameterError(f"{node}: no parameter {name!r}")
                check_type(declared[name], value)
        return request.values

    def _update(self, node: str, values: Mapping[str, Any]) -> None:
        try:
            self._nodes[node].update(values)
        except ParameterError as error:
            raise ParameterError(f"{node}: {error}") from None

    def _begin(self, request: NodeAct) -> None:
        members = [] if self._graph is None else self._graph.members
        if not any(m.name == request.node and request.action in m.type.actions for m in members):
            raise UsageError(f"no such action: {request.node}.{request.action}")
        self._act(request.node, request.action)

    def _specs(self, node: str) -> list[Spec]:
        """The parameters of a node that browsers can set; raises UsageError without that node."""
        if node not in self._nodes:
            raise UsageError(f"no such node: {node}")
        return shown_specs(self._nodes[node].current)

    def _of(self, node: str) -> dict[str, Any]:
        """The values of a node as they are sent."""
        specs = self._specs(node)
        current = self._nodes[node].current
        return {spec.name: sent(getattr(current, spec.name)) for spec in specs}

    @property
    def _nodes(self) -> Mapping[str, Parameters[Any]]:
        """The parameters of the present nodes."""
        return {} if self._runtime is None else live_parameters(self._runtime)

    def _tick(self) -> None:
        with self._following:
            if self._runtime is not None and self._runtime.graph is not self._graph:
                self._rest()
                self._follow()
            self._read()
        self._notices.show(self._board)

    def _follow(self) -> None:
        """Show the nodes of the present graph, and hear of all changes."""
        self._graph = None if self._runtime is None else self._runtime.graph
        nodes, members = self._nodes, [] if self._graph is None else self._graph.members
        for node, parameters in nodes.items():
            self.settings.meet(node, parameters)
            self._forget.append(parameters.on_change(partial(self._changed, node)))
        own = {f"{kind}/{member.name}" for member in members for kind in ("node", "values")}
        self._board.keep({"graph", "state", "notices", *own})
        self._board.put("graph", {"graph": [member.name for member in members], "run": self._run})
        for member in members:
            self._board.put(f"node/{member.name}", _described(member, nodes.get(member.name)))
        self._restore()
        for node in nodes:
            self._show(node)
        self._show_state()

    @property
    def _playback(self) -> Playback | None:
        """The playback of a recording, or None."""
        runtime = self._runtime
        return None if runtime is None or runtime.graph.live else runtime.playback

    def _restore(self) -> None:
        """Set what waits for the present nodes: of each node as one whole, else one by one."""
        if self._playback is not None:
            restore_range(self._playback, self.settings, self._notices.note)
        for node, parameters in self._nodes.items():
            values = self.settings.take(node, parameters)
            try:
                parameters.update(values)
            except ParameterError:
                for name, value in values.items():
                    try:
                        self._update(node, {name: value})
                    except ParameterError as error:
                        self._notices.note(str(error))

    def _changed(self, node: str, *_: object) -> None:
        self._worker.post(("show", node), partial(self._show, node))

    def _show(self, node: str) -> None:
        """Send the values of a node."""
        parameters = self._nodes.get(node)
        if parameters is None:
            return
        current = parameters.current
        shown = shown_specs(current)
        values = {spec.name: sent(getattr(current, spec.name)) for spec in shown}
        unused = [spec.name for spec in shown if not spec.used(current)]
        first = self.settings.first(node)
        message = {"of": node, "values": values, "unused": unused, "first": first}
        self._board.put(f"values/{node}", message)
        self._show_state()

    def _show_state(self) -> None:
        """Send the preset that is chosen."""
        state: dict[str, Any] = {"presets": [], "preset": ""}
        nodes = {node: live.current for node, live in self._nodes.items()}
        try:
            if self._graph is not None:
                state |= {"preset": chosen(self._graph, nodes), "presets": NAMES}
        except (UsageError, KeyError):  # nothing here has presets
            pass
        self._board.put("state", state)

    def _read(self) -> None:
        """Send the texts that browsers read, and follow no others."""
        if self._runtime is None:
            return
        members = [] if self._graph is None else self._graph.members
        there = {topic for member in members for topic in texts_of(member)}
        wanted = there.intersection(
            {topic for read in list(self._reading.values()) for topic in read}
        )
        for topic in self._feeds.keys() - wanted:
            self._feeds.pop(topic).follow(None)
        for topic in wanted:
            if topic not in self._feeds:
                self._feeds[topic] = Feed(self._runtime)
            self._feeds[topic].follow(topic)
            message = self._feeds[topic].take()
            if isinstance(message, Text):
                self._board.put(f"text/{topic}", {"topic": topic, "html": to_html(message.text)})

    def _rest(self) -> None:
        """Hear of nothing any more."""
        for forget in self._forget:
            forget()
        self._forget = []
        for feed in self._feeds.values():
            feed.follow(None)
        self._feeds = {}


def _key(request: _Change) -> str:
    """A key: only the newest of the requests with the same one is done."""
    if isinstance(request, Set):
        return ",".join(f"{node}/{name}" for node, one in request.values.items() for name in one)
    return f"{type(request).__name__} {request}"


def _described(member: Member, parameters: Parameters[Any] | None) -> Mapping[str, Any]:
    shown = [] if parameters is None else shown_specs(parameters.current)
    return {
        "node": member.name,
        "help": member.type.doc,
        "params": [declaration(spec) for spec in shown],
        "actions": actions_of(member),
        "texts": texts_of(member),
    }

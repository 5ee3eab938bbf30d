"""One connected viewer: its requests, and the messages for it."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine, Mapping
from functools import partial
from operator import is_
from typing import TYPE_CHECKING, Any

from ros_visualise.core.errors import ParameterError
from ros_visualise.runtime.bridge.services import answer
from ros_visualise.ui.live.foxglove import messages
from ros_visualise.ui.live.foxglove.feed import Encoded
from ros_visualise.ui.live.foxglove.messages import (
    BadRequest,
    CallService,
    ControlPlayback,
    FollowParameters,
    GetParameters,
    LeaveParameters,
    Request,
    SetParameters,
    Subscribe,
    Unsubscribe,
    as_text,
    status,
)
from ros_visualise.ui.live.foxglove.parameters import Nodes, changes_of, values_of
from ros_visualise.ui.live.foxglove.playback import SeenState, control, describe, seen_state
from ros_visualise.ui.live.foxglove.queue import ViewerQueue
from ros_visualise.ui.server.answers import READ_ONLY
from ros_visualise.ui.server.gate import Receive, Send

if TYPE_CHECKING:
    from ros_visualise.ui.live.foxglove.hub import FoxgloveHub, OfferedGraph

_PERIOD_S = 0.05
_DROPS_TICKS = 20
_MOST_CALLS = 8
"""Services and changes of parameters in progress."""
_TRIGGER = "std_srvs/srv/Trigger"
_CAPABILITIES = ("parameters", "parametersSubscribe", "services")


class FoxgloveViewer:
    """A viewer's connection.

    Args:
        hub: what it looks at.
        protocol: the chosen subprotocol.
        is_viewer: it may only look.
    """

    def __init__(self, hub: FoxgloveHub, protocol: str, is_viewer: bool) -> None:
        self._hub, self._protocol, self._is_viewer = hub, protocol, is_viewer
        self._queue = ViewerQueue()
        self._shown: OfferedGraph | None = None
        self._info = ""
        self._subscriptions: dict[int, int] = {}  # channel -> number that the viewer chose
        self._channels: dict[str, int] = {}  # topic -> channel, of those
        self._followed: set[str] = set()  # parameters
        self._values: dict[str, Mapping[str, Any]] = {}
        self._seen: list[Any] = []  # parameters of the nodes when their changes were last sent
        self._state: SeenState | None = None
        self._now_ns = -1
        self._lost = 0
        self._ticks = 0
        self._calls: set[asyncio.Task[None]] = set()

    async def run(self, receive: Receive, send: Send) -> None:
        """Serve it until it leaves."""
        tasks = [asyncio.ensure_future(self._send_all(send)), asyncio.ensure_future(self._inform())]
        tasks.append(asyncio.ensure_future(self._hear_all(receive)))
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            every = [*tasks, *self._calls]
            for task in every:
                task.cancel()
            results = await asyncio.gather(*every, return_exceptions=True)
        for result in results:
            if isinstance(result, Exception) and not isinstance(result, OSError):  # it has gone
                raise result

    def put(self, topic: str, encoded: Encoded) -> None:
        """Send it a message."""
        channel = self._channels.get(topic)
        if channel is not None:
            self._queue.put(channel, self._subscriptions[channel], *encoded)

    async def _send_all(self, send: Send) -> None:
        while True:
            message = await self._queue.take()
            kind = "text" if isinstance(message, str) else "bytes"
            await send({"type": "websocket.send", kind: message})

    async def _hear_all(self, receive: Receive) -> None:
        while True:
            message = await receive()
            if message["type"] == "websocket.disconnect":
                return
            try:
                data = message.get("text")
                self._hear(messages.parse(message["bytes"] if data is None else data))
            except BadRequest as error:
                self._queue.reply(status(2, str(error)))
            await self._queue.wait_for_room()

    def _hear(self, request: Request) -> None:
        if isinstance(request, Subscribe):
            for one in request.subscriptions:
                self._subscribe(one.id, one.channel_id)
        elif isinstance(request, Unsubscribe):
            for number in request.subscription_ids:
                self._unsubscribe(number)
        elif isinstance(request, GetParameters):
            self._send_parameters(request.parameter_names, request.id)
        elif isinstance(request, SetParameters):
            self._require_control()
            self._begin(self._set_parameters(request))
        elif isinstance(request, FollowParameters):
            known = values_of(self._nodes)
            self._followed |= known.keys() & (set(request.parameter_names) or known.keys())
            self._seen = []
        elif isinstance(request, LeaveParameters):
            self._followed -= set(request.parameter_names) or self._followed
        elif isinstance(request, CallService):
            self._call(request)
        else:
            self._control(request)

    def _require_control(self) -> None:
        if self._is_viewer:
            raise BadRequest(READ_ONLY)
        if len(self._calls) >= _MOST_CALLS:
            raise BadRequest("busy: earlier requests are still in progress; try again")

    def _begin(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.ensure_future(work)
        self._calls.add(task)
        task.add_done_callback(self._calls.discard)

    # Channels

    def _subscribe(self, number: int, channel: int) -> None:
        if self._shown is None or channel not in self._shown.channels:
            raise BadRequest(f"no channel {channel}")
        if number in self._subscriptions.values() or channel in self._subscriptions:
            raise BadRequest(f"subscription {number} to channel {channel}: already subscribed")
        topic = self._shown.channels[channel][0]
        self._subscriptions[channel] = number
        self._channels[topic] = channel
        self._hub.follow(topic, self)

    def _unsubscribe(self, number: int) -> None:
        for channel, chosen in list(self._subscriptions.items()):
            if chosen == number:
                self._leave(channel)

    def _leave(self, channel: int) -> None:
        if self._subscriptions.pop(channel, None) is not None:
            topic = next(name for name, one in self._channels.items() if one == channel)
            del self._channels[topic]
            self._queue.forget(channel)
            self._hub.leave(topic, self)

    # Parameters

    @property
    def _nodes(self) -> Nodes:
        return {} if self._shown is None else self._shown.runtime.parameters

    def _send_parameters(self, names: list[str], id: str | None = None) -> None:
        found = values_of(self._nodes, set(names) or None)
        self._queue.reply(as_text("parameterValues", parameters=list(found.values()), id=id))

    async def _set_parameters(self, request: SetParameters) -> None:
        """Change parameters; send the present values."""
        is_rejected = False
        for change in changes_of(request.parameters):
            try:
                await self._hub.pool.do(partial(change.apply, self._nodes))
            except ParameterError as error:
                self._queue.reply(status(2, f"{change.node}: {error}"))
                is_rejected = True
        names = [given.name for given in request.parameters]
        if names and (is_rejected or request.id is not None):
            self._send_parameters(names, request.id)

    # Services and playback

    def _call(self, call: CallService) -> None:
        try:
            self._require_control()
            if self._shown is None or call.service_id not in self._shown.services:
                raise BadRequest(f"no service {call.service_id}")
            if call.encoding != "cdr":
                raise BadRequest("unsupported encoding; use cdr")
        except BadRequest as error:
            ids = {"serviceId": call.service_id, "callId": call.call_id}
            self._queue.reply(as_text("serviceCallFailure", **ids, message=str(error)))
        else:
            self._begin(self._act(self._shown, call))

    async def _act(self, shown: OfferedGraph, call: CallService) -> None:
        act = partial(shown.runtime.act, *shown.services[call.service_id])
        success, text = await self._hub.pool.do(partial(answer, act))
        self._queue.reply(messages.service_response(call, success, text))

    def _control(self, request: ControlPlayback) -> None:
        self._require_control()
        line = None if self._shown is None else self._shown.line
        if line is None:
            raise BadRequest("this source can neither pause nor seek")
        try:
            control(line, request)
        except BadRequest as error:
            self._queue.reply(status(2, str(error)))
        self._queue.reply(describe(line, request.seek_ns is not None, request.id))

    # What it is sent without a request

    async def _inform(self) -> None:
        while True:
            if self._queue.has_room:
                offered = await self._hub.offered()
                if self._shown is not None and _session(offered) != self._shown.session:
                    self._show(None)
                self._send_info(offered)
                if offered is not self._shown or not self._ticks:
                    self._show(offered)
                self._send_changes()
                self._send_time()
                self._ticks += 1
                if self._ticks % _DROPS_TICKS == 0:
                    self._send_drops()
            await asyncio.sleep(_PERIOD_S)

    def _send_info(self, offered: OfferedGraph | None) -> None:
        """Send what it needs to know of the graph, whenever that changes."""
        about: dict[str, Any] = {"sessionId": _session(offered)}
        capabilities = list(_CAPABILITIES)
        line = None if offered is None else offered.line
        if line is not None:
            capabilities.append("time")
            range_ns = line.range_ns
            if self._protocol == messages.NEWER and range_ns and not self._is_viewer:
                capabilities.append("playbackControl")
                start, end = map(messages.split_ns, range_ns)
                about |= {"dataStartTime": start, "dataEndTime": end}
        about |= {"capabilities": capabilities, "supportedEncodings": ["cdr"]}
        info = as_text("serverInfo", name="ros_visualise", **about)
        if info != self._info:
            self._queue.reply(info)
        self._info = info

    def _show(self, offered: OfferedGraph | None) -> None:
        before, self._shown = self._shown, offered
        old, new = _channels(before), _channels(offered)
        if gone := sorted(old.keys() - new.keys()):
            for channel in gone:
                self._leave(channel)
            self._queue.reply(as_text("unadvertise", channelIds=gone))
        adverts = [new[number][1] for number in new if number not in old]
        if adverts or not self._ticks:
            self._queue.reply(as_text("advertise", channels=adverts))
        old_services, services = self._services(before), self._services(offered)
        if gone := sorted(old_services.keys() - services.keys()):
            self._queue.reply(as_text("unadvertiseServices", serviceIds=gone))
        if added := [_service(i, *services[i]) for i in services if i not in old_services]:
            self._queue.reply(as_text("advertiseServices", services=added))
        self._state = None

    def _services(self, offered: OfferedGraph | None) -> Mapping[int, tuple[str, str]]:
        return {} if offered is None or self._is_viewer else offered.services

    def _send_changes(self) -> None:
        """Send the followed parameters that have changed."""
        present = [parameters.current for parameters in self._nodes.values()]
        is_same = len(present) == len(self._seen) and all(map(is_, present, self._seen))
        self._seen = present
        if is_same or not self._followed:
            return
        values = values_of(self._nodes, self._followed)
        changed = [value for name, value in values.items() if self._values.get(name) != value]
        self._values = values
        if changed:
            self._queue.reply(as_text("parameterValues", parameters=changed))

    def _send_time(self) -> None:
        """Send the present time and the state of playback, whenever they change."""
        line = None if self._shown is None else self._shown.line
        if line is None:
            return
        before, self._state = self._state, seen_state(line)
        if self._state != before and "playbackControl" in self._info:
            did_seek = before is not None and before.epoch != self._state.epoch
            self._queue.reply(describe(line, did_seek))
        before_ns, self._now_ns = self._now_ns, line.now_ns
        if self._now_ns != before_ns:
            self._queue.reply(messages.time_message(self._now_ns))

    def _send_drops(self) -> None:
        """Report dropped messages, in place of the earlier report."""
        lost = {
            topic: self._queue.dropped[channel] + feed.dropped
            for topic, channel in self._channels.items()
            if (feed := self._hub.feed(topic)) is not None
        }
        total = sum(lost.values())
        if total and total != self._lost:
            listed = ", ".join(f"{topic}: {count}" for topic, count in lost.items() if count)
            reasons = {feed.warning for t in lost if (feed := self._hub.feed(t)) and feed.warning}
            text = "; ".join([f"messages dropped: {listed}", *sorted(reasons)])
            self._queue.reply(status(1, text, "dropped"))
        self._lost = total


def _session(offered: OfferedGraph | None) -> str:
    return "" if offered is None else offered.session


def _channels(offered: OfferedGraph | None) -> Mapping[int, tuple[str, Mapping[str, Any]]]:
    return {} if offered is None else offered.channels


def _service(number: int, node: str, action: str) -> Mapping[str, Any]:
    about = {"encoding": "cdr", "schemaEncoding": "ros2msg"}
    response = "bool success\nstring message"
    return {
        "id": number,
        "name": f"/{node}/{action}",
        "type": _TRIGGER,
        "request": {**about, "schemaName": f"{_TRIGGER}_Request", "schema": ""},
        "response": {**about, "schemaName": f"{_TRIGGER}_Response", "schema": response},
        "requestSchema": "",  # as viewers of 2023 expect it
        "responseSchema": response,
    }

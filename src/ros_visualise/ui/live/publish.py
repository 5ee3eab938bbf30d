"""Messages that people publish from browsers: once, or at a rate while the browser is there."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Annotated, Any

import msgspec
from msgspec import Meta

from ros_visualise.core.errors import DamagedMessage, RosVisualiseError, UsageError, did_you_mean
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.filling import described, fill
from ros_visualise.messages.recorded import Recorded
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.live.asked import Asked, Name, understand
from ros_visualise.ui.live.board import LiveBoard, Visitor
from ros_visualise.ui.live.exchange import ignore
from ros_visualise.ui.server.gate import Receive, Scope, Send, Visit
from ros_visualise.ui.worker import PageWorker

_PERIOD_S, _CLOSE_S = 0.02, 0.3
_LOOKED = 25  # ticks between two looks at the graph
_MOST_RATES = 20
_OFF = "Publishing is off. Start the program with --allow-control."

_Topic = Annotated[str, Meta(max_length=256, pattern=r"^/[A-Za-z0-9_][A-Za-z0-9_/]*$")]
_Hz = Annotated[float, Meta(ge=0, le=50)]


class DescribeType(Asked, tag="describe"):
    """Send the fields of a type."""

    type: Name
    topic: Name = ""


class PublishMessage(Asked, tag="publish"):
    """Publish a message; ``rate``: again and again, Hz; 0: once.

    ``panel``: a name that the browser gives the form; its rate ends with its next request.
    """

    panel: Name
    topic: _Topic
    type: Name
    values: dict[str, Any]
    rate: _Hz = 0.0


class StopPublishing(Asked, tag="stop"):
    """End the rate of a form."""

    panel: Name


_DECODER = msgspec.json.Decoder(DescribeType | PublishMessage | StopPublishing)
_Form = tuple[Visitor, str]


class _Repeated:
    """A message that a form publishes, and when the next time comes."""

    def __init__(self, request: PublishMessage) -> None:
        self.request = request
        self.next_s = time.monotonic()
        self.count = 0


class PublishHub:
    """Serves the forms of all browsers.

    Args:
        is_allowed: messages may be published.
        say: called with the reason of a failure, one line.
    """

    path = "/live/publish"

    def __init__(
        self, loop: asyncio.AbstractEventLoop, say: Callable[[str], None], is_allowed: bool
    ) -> None:
        self._board, self._is_allowed = LiveBoard(loop), is_allowed
        self._runtime: Runtime | None = None
        self._own = Definitions("cdr")
        self._repeated: dict[_Form, _Repeated] = {}
        self._ticks = 0
        self._worker = PageWorker(say, self._tick, _PERIOD_S)
        if not is_allowed:
            self._board.put("offer", {"allowed": False, "reason": _OFF})

    def show(self, runtime: Runtime | None) -> None:
        """Publish to this graph from now on, or to none; from any thread."""
        self._runtime, self._ticks = runtime, 0
        if self._is_allowed:
            self._worker.post("new", self._repeated.clear)
            self._worker.start()

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one browser until it leaves: it sends requests, and gets lists of messages."""
        visit: Visit = scope["state"]["visit"]
        visitor = Visitor()
        may = self._is_allowed and not visit.is_viewer
        hear = partial(self._hear, visitor) if may else ignore
        try:
            await self._board.serve(receive, send, visitor, hear)
        finally:
            self._worker.post(visitor, partial(self._leave, visitor))

    def close(self) -> None:
        """End its thread."""
        self._worker.close(_CLOSE_S)

    def _hear(self, visitor: Visitor, text: str) -> None:
        request = understand(_DECODER, text)
        if isinstance(request, DescribeType):
            self._worker.ask((visitor, "type"), partial(self._describe, visitor, request))
        elif isinstance(request, PublishMessage):
            self._worker.ask((visitor, request.panel), partial(self._start, visitor, request))
        elif isinstance(request, StopPublishing):
            form = visitor, request.panel
            self._worker.post(form, partial(self._repeated.pop, form, None))
        else:
            self._board.tell(visitor, "problem", {"problem": "invalid topic, rate or values"})

    def _leave(self, visitor: Visitor) -> None:
        for form in [one for one in self._repeated if one[0] is visitor]:
            del self._repeated[form]

    def _describe(self, visitor: Visitor, request: DescribeType) -> None:
        try:
            types = self._types(request.topic, request.type)
            fields = described(types.store, request.type)
        except RosVisualiseError as error:
            self._board.tell(visitor, "problem", {"problem": str(error), "type": request.type})
        else:
            self._board.tell(visitor, "fields", {"fields": fields, "type": request.type})

    def _start(self, visitor: Visitor, request: PublishMessage) -> None:
        form = visitor, request.panel
        self._repeated.pop(form, None)
        repeated = _Repeated(request)
        if self._publish(form, repeated) and request.rate:
            if len(self._repeated) >= _MOST_RATES:
                self._tell(
                    form,
                    problem=f"{_MOST_RATES} messages are already being repeated; stop one first",
                )
                return
            self._repeated[form] = repeated

    def _tick(self) -> None:
        now_s = time.monotonic()
        for form, repeated in list(self._repeated.items()):
            if now_s >= repeated.next_s and not self._publish(form, repeated):
                self._repeated.pop(form, None)
        if self._ticks % _LOOKED == 0 and self._board.is_watched:
            self._offer()
        self._ticks += 1

    def _publish(self, form: _Form, repeated: _Repeated) -> bool:
        """Publish a message of a form; False if that fails, with the reason sent."""
        request, runtime = repeated.request, self._runtime
        try:
            if runtime is None or not (runtime.publishes or request.topic in runtime.graph.inputs):
                raise UsageError(f"{request.topic}: no node subscribes to it")
            runtime.publish(request.topic, self._made(request, runtime))
        except RosVisualiseError as error:
            self._tell(form, problem=str(error))
            return False
        repeated.count += 1
        if request.rate:
            period_s = 1 / request.rate
            repeated.next_s = max(repeated.next_s + period_s, time.monotonic() - period_s)
        self._tell(form, count=repeated.count)
        return True

    def _made(self, request: PublishMessage, runtime: Runtime) -> Recorded:
        """The message; a header without a stamp gets the present time.

        Raises:
            RosVisualiseError: the values do not fit the type, or the topic has another type.
        """
        kind = runtime.graph.inputs.get(request.topic)
        if kind is not None and kind.type_name != request.type:
            raise UsageError(f"{request.topic} is of type {kind.type_name}")
        types = self._types(request.topic, request.type)
        message = fill(types.store, request.type, request.values)
        now_ns = time.time_ns()
        if types.starts_with_header(request.type):
            stamp = message.header.stamp
            if not (stamp.sec or stamp.nanosec):
                stamp.sec, stamp.nanosec = divmod(now_ns, 10**9)
        return Recorded(request.type, types.write(request.type, message), types, now_ns)

    def _types(self, topic: str, type_name: str) -> Definitions:
        """The definitions with a type: those of the topic, of others of that type, or ROS's.

        Raises:
            DamagedMessage: none of them has it.
        """
        for types in (*_definitions(self._runtime, topic, type_name), self._own):
            if types.knows(type_name):
                return types
        known = self._own.store.fielddefs
        raise DamagedMessage(f"unknown type {type_name!r}{did_you_mean(type_name, known, False)}")

    def _offer(self) -> None:
        """Show topics and types to all browsers."""
        runtime = self._runtime
        if runtime is None:
            return
        topics = {topic: kind.type_name for topic, kind in runtime.graph.inputs.items()}
        types = set(topics.values())
        if runtime.publishes:
            topics |= {topic: spec.ros.name for topic, spec in runtime.graph.topics.items()}
            types |= {*topics.values(), *self._own.store.fielddefs}
        self._board.put(
            "offer",
            {
                "allowed": True,
                "any": runtime.publishes,
                "topics": dict(sorted(topics.items())),
                "types": sorted(types),
            },
        )

    def _tell(self, form: _Form, **news: Any) -> None:
        visitor, panel = form
        self._board.tell(visitor, f"news {panel}", {"panel": panel, **news})


def _definitions(runtime: Runtime | None, topic: str, type_name: str) -> list[Definitions]:
    """Definitions of a graph that may have a type; those of a topic first."""
    if runtime is None:
        return []
    topics: Mapping[str, Any] = runtime.graph.topics
    ordered = sorted(topics.items(), key=lambda item: item[0] != topic)
    found = [spec.ros.definitions for _, spec in ordered if spec.ros.name == type_name]
    return [one for one in found if one is not None][:1]

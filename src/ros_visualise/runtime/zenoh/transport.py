"""Zenoh as a transport; see `ros_visualise.runtime.middleware.Transport`."""

from __future__ import annotations

import threading
from collections import defaultdict
from collections.abc import Callable
from functools import partial
from typing import Any

import zenoh

from ros_visualise.core import supervision
from ros_visualise.core.errors import RosVisualiseError, Unreachable
from ros_visualise.core.params import Parameters
from ros_visualise.core.rate import Clock, WallClock
from ros_visualise.data import CameraInfo
from ros_visualise.messages import from_message
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.bridge.services import answer
from ros_visualise.runtime.middleware import Handle, Listing, ParametersListener, Transport
from ros_visualise.runtime.zenoh import keys
from ros_visualise.runtime.zenoh.errors import translated
from ros_visualise.runtime.zenoh.parameters import ZenohParametersClient, ZenohServedParameters
from ros_visualise.runtime.zenoh.session import Endpoints, ZenohSession
from ros_visualise.runtime.zenoh.topics import DEFINITIONS, ZenohPublisher, ZenohSubscriber

_ANSWER_S = 60.0
_MOST_CALLS = 16
_REQUEST = b"\0\1\0\0\0"  # a CDR structure without fields
_NETWORK = "the Zenoh network"
_ANSWER = "std_srvs/msg/TriggerAnswer"  # a name of ours for the response of a service
DEFINITIONS.define(_ANSWER, "bool success\nstring message")


class ZenohTransport(Transport):
    """A node on a Zenoh network.

    Args:
        name: of the node, with its namespace: ``uav1/demo``.
        endpoints: addresses to connect to or to listen on.

    Raises:
        UsageError: an address is none.
        OpenError: it cannot be listened on.
    """

    def __init__(self, name: str, endpoints: Endpoints) -> None:
        self._session = ZenohSession(name, endpoints)

    def close(self) -> None:
        self._session.close()

    def resolve(self, name: str) -> str:
        node = self._session.node
        if name.startswith("~"):
            return keys.legal(f"{node}/{name[1:]}")
        namespace = node.rpartition("/")[0]
        return keys.legal(name if name.startswith("/") else f"{namespace}/{name}")

    @translated(_NETWORK)
    def advertise(self, topic: str, type: TopicType) -> ZenohPublisher:
        return ZenohPublisher(self._session, self.resolve(topic), type)

    @translated(_NETWORK)
    def subscribe(
        self, topic: str, kind: type, take: Callable[[Any], None], reject: Callable[[str], None]
    ) -> ZenohSubscriber:
        return ZenohSubscriber(self._session, self.resolve(topic), kind, take, reject)

    @translated(_NETWORK)
    def offer(self, action: str, act: Callable[[], str | None]) -> Handle:
        return ZenohService(self._session, self.resolve(action), keys.TRIGGER, lambda _: act())

    @translated(_NETWORK)
    def offer_calibration(self, service: str, take: Callable[[CameraInfo], None]) -> Handle:
        def taken(request: bytes) -> None:
            read = DEFINITIONS.read(CameraInfo.type_name, request)
            take(from_message(read, CameraInfo))

        return ZenohService(self._session, self.resolve(service), keys.SET_CAMERA_INFO, taken)

    def call(self, action: str) -> None:
        key = keys.topic_key(action, *keys.TRIGGER)
        with translated(action):
            replies = self._session.zenoh.get(key, payload=_REQUEST, timeout=_ANSWER_S)
            reply = next(iter(replies), None)
        if reply is None or reply.ok is None:
            raise Unreachable(f"{action}: not offered, or no answer")
        trigger = DEFINITIONS.read(_ANSWER, reply.ok.payload.to_bytes())
        if not trigger.success:
            raise RosVisualiseError(f"{action.rpartition('/')[0]}: {trigger.message}")

    @translated(_NETWORK)
    def serve_parameters(
        self, parameters: Parameters[Any], namespace: str
    ) -> ZenohServedParameters:
        return ZenohServedParameters(self._session, parameters, self.resolve(f"~{namespace}"))

    @translated(_NETWORK)
    def follow_parameters(self, node: str, listener: ParametersListener) -> ZenohParametersClient:
        return ZenohParametersClient(self._session, node, listener)

    @translated(_NETWORK)
    def listing(self) -> Listing:
        if not self._session.is_connected:
            raise Unreachable("no connection to a peer")
        ends: dict[str, dict[str, list[str]]] = defaultdict(lambda: defaultdict(list))
        types: dict[str, str] = {}
        for one in self._session.graph.entities():
            if one.kind == keys.PARAMETERS:
                ends[one.kind][one.node].append(one.name)
            else:
                ends[one.kind][one.name].append(one.node)
            if one.kind in (keys.PUBLISHER, keys.SUBSCRIBER):
                types.setdefault(one.name, one.type)
        publishers, subscribers = ends[keys.PUBLISHER], ends[keys.SUBSCRIBER]
        viewers = {n for n in ends[keys.NODE][""] if n.rpartition("/")[2].startswith("view")}
        return Listing(
            list(publishers.items()),
            list(subscribers.items()),
            types,
            ends[keys.PARAMETERS],
            viewers,
        )

    def clock(self) -> Clock:
        return WallClock()


class ZenohService:
    """Answers queries by success and a text, each on a thread of its own.

    Args:
        session: of this process.
        name: full name of the service.
        type: its type and hash.
        act: is given a request's bytes.
    """

    def __init__(
        self,
        session: ZenohSession,
        name: str,
        type: tuple[str, str],
        act: Callable[[bytes], str | None],
    ) -> None:
        self._name, self._act = name, act
        self._key = keys.topic_key(name, *type)
        self._free = threading.BoundedSemaphore(_MOST_CALLS)
        self._queryable = session.zenoh.declare_queryable(self._key, self._take, complete=True)
        self._token, _ = session.declare(keys.SERVICE, name, *type)
        self._closed = False

    def close(self) -> None:
        """Offer it no longer."""
        if not self._closed:
            self._closed = True
            self._token.undeclare()
            self._queryable.undeclare()

    def _take(self, query: zenoh.Query) -> None:
        if self._free.acquire(blocking=False):
            supervision.start(self._name, partial(self._answer, query))
        else:
            with query:
                query.reply_err("too many calls at once")

    def _answer(self, query: zenoh.Query) -> None:
        try:
            with query, translated(self._name):
                request = b"" if query.payload is None else query.payload.to_bytes()
                done, text = answer(lambda: self._act(request))
                trigger = DEFINITIONS.types[_ANSWER](done, text)
                written = bytes(DEFINITIONS.write(_ANSWER, trigger))
                query.reply(self._key, written, attachment=query.attachment)
        finally:
            self._free.release()

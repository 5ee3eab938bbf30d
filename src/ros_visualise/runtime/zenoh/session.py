"""A node's session: its connections, and the graph as the tokens of all peers say it.

Nothing is found by multicast, and nothing listens unless asked. Who listens is a Zenoh router, who
connects is its client: the router hands on what goes from one client to another.
"""

from __future__ import annotations

import json
import logging
import math
import threading
import time
from collections import Counter
from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import count

import zenoh

from ros_visualise.core import supervision
from ros_visualise.core.errors import OpenError, Unreachable, UsageError
from ros_visualise.core.limits import max_memory
from ros_visualise.messages.qos import QoS
from ros_visualise.runtime.zenoh import keys
from ros_visualise.runtime.zenoh.errors import translated
from ros_visualise.runtime.zenoh.keys import Entity

log = logging.getLogger(__name__)

_AGAIN_S = 0.5
_END_S = 1.0
_STALL_US = 1_000_000
"""For so long a peer that stopped reading may hold up a topic; then it is disconnected."""
_SHARE = 4  # of the memory of one input that a message may take
_MOST_TOKENS = 20_000


@dataclass(frozen=True)
class Endpoints:
    """Addresses as ``tcp/192.168.1.10:7447``: those to connect to, or those to listen on.

    ``wait_s`` is how long a peer is waited for before `Unreachable` is raised.
    """

    connect: Sequence[str] = ()
    listen: Sequence[str] = ()
    wait_s: float = math.inf

    def __str__(self) -> str:
        return " or ".join((*self.listen, *self.connect))


class ZenohSession:
    """A session that is open.

    Args:
        node: full name of the node, such as ``/demo``.
        endpoints: of this process.

    Attributes:
        node: full name of the node.
        zenoh: the library's session.
        graph: who is there.

    Raises:
        UsageError: an address is none.
        OpenError: it cannot be listened on.
    """

    def __init__(self, node: str, endpoints: Endpoints) -> None:
        self.node = keys.legal(f"/{node.strip('/')}")
        self.zenoh = _opened(endpoints)
        self.id = str(self.zenoh.zid())
        self.graph = GraphView()
        self._numbers = count()
        self._endpoints = endpoints
        self._closed = threading.Event()
        for key in (keys.GRAPH, keys.OWN_GRAPH):
            self.zenoh.liveliness().declare_subscriber(key, self.graph.take, history=True)
        self._token, _ = self.declare(keys.NODE)
        if endpoints.connect:
            supervision.start("connection", self._watch, again_s=_AGAIN_S)

    @property
    def is_connected(self) -> bool:
        """True while a peer is there, or may connect."""
        info = self.zenoh.info
        return bool(self._endpoints.listen or info.routers_zid() or info.peers_zid())

    def declare(
        self, kind: str, name: str = "", type: str = "", digest: str = "", qos: QoS | None = None
    ) -> tuple[zenoh.LivelinessToken, str]:
        """Show an entity of this node to all peers: its token, and the token's key."""
        entity = Entity(kind, self.id, self.node, name, type)
        key = keys.token(entity, next(self._numbers), digest, qos)
        return self.zenoh.liveliness().declare_token(key), key

    def close(self) -> None:
        """Leave the network; more than once does no harm."""
        self._closed.set()
        supervision.start("end", self._close).join(_END_S)

    def _close(self) -> None:
        with suppress(zenoh.ZError):  # a peer that stopped reading
            self.zenoh.close()

    def _watch(self) -> None:
        """Report, once, that the connection is lost or back."""
        was_connected = True
        while not self._closed.wait(_AGAIN_S):
            is_connected = self.is_connected
            if was_connected and not is_connected:
                log.warning("lost the connection to %s; reconnecting", self._endpoints)
            elif is_connected and not was_connected:
                log.info("connected to %s again", self._endpoints)
            was_connected = is_connected


class GraphView:
    """Everybody's tokens, as far as they are known here."""

    def __init__(self) -> None:
        self._entities: dict[str, Entity] = {}
        self._ends: Counter[tuple[str, str, str]] = Counter()
        self._changed = threading.Condition()

    def take(self, sample: zenoh.Sample) -> None:
        """A token came or went."""
        key = str(sample.key_expr)
        with self._changed:
            if sample.kind == zenoh.SampleKind.DELETE:
                if gone := self._entities.pop(key, None):
                    self._ends.subtract([(gone.kind, gone.name, gone.type)])
                    self._ends += Counter()  # without those that are 0 now
            elif (entity := keys.parse(key)) and len(self._entities) < _MOST_TOKENS:
                self._ends[entity.kind, entity.name, entity.type] += key not in self._entities
                self._entities[key] = entity
            self._changed.notify_all()

    def entities(self) -> Collection[Entity]:
        """All that are there."""
        with self._changed:
            return tuple(self._entities.values())

    def count(self, kind: str, name: str, type: str) -> int:
        """The number of publishers or subscribers of a topic."""
        return self._ends[kind, name, type]

    def session_of(self, place: str) -> str | None:
        """Id of the session that has these live parameters, if it is there."""
        found = (e for e in self.entities() if e.kind == keys.PARAMETERS and e.name == place)
        return next((entity.session for entity in found), None)

    def wait(self, timeout_s: float) -> None:
        """Wait for a change."""
        with self._changed:
            self._changed.wait(timeout_s)


def _opened(endpoints: Endpoints) -> zenoh.Session:
    """A session, as soon as there is a peer to connect to."""
    if bool(endpoints.connect) == bool(endpoints.listen):
        raise UsageError("give addresses either to connect to or to listen on")
    with translated(f"invalid address {endpoints}", UsageError):
        config = zenoh.Config.from_json5(json.dumps(_settings(endpoints)))
    if endpoints.listen:
        with translated(f"cannot listen on {endpoints}", OpenError):
            return zenoh.open(config)
    is_reported = False
    end_s = time.monotonic() + endpoints.wait_s
    while True:
        try:
            with translated(f"no peer at {endpoints} yet"):
                return zenoh.open(config)
        except Unreachable as error:
            if time.monotonic() > end_s:
                raise Unreachable(
                    f"no peer found at {endpoints} within {endpoints.wait_s:g} s"
                ) from error
            if not is_reported:
                log.warning("no peer at %s yet; waiting for it", endpoints)
                log.debug("%s", error)
            is_reported = True
            time.sleep(_AGAIN_S)


def _settings(endpoints: Endpoints) -> dict[str, object]:
    block = {"wait_before_close": _STALL_US}
    return {
        "mode": "router" if endpoints.listen else "client",
        "connect": {"endpoints": list(endpoints.connect), "timeout_ms": 0},
        "listen": {"endpoints": list(endpoints.listen), "timeout_ms": 0},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "timestamping": {"enabled": True},  # latched messages need it
        "transport": {
            "link": {
                "rx": {"max_message_size": max_memory() // _SHARE},
                "tx": {"queue": {"congestion_control": {"block": block}}},
            },
        },
    }

"""The connection to a server of live messages, opened again when it fails."""

from __future__ import annotations

import logging
import re
import socket
import struct
import threading
import time
from collections import Counter, deque
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress

from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidURI
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from ros_visualise.core import supervision
from ros_visualise.core.errors import DamagedMessage, OpenError, Unreachable
from ros_visualise.core.limits import max_memory, unpacked_limit
from ros_visualise.core.printing import sized, without_secrets
from ros_visualise.messages.recorded import Recorded
from ros_visualise.sources.recordings.schemas import Schemas
from ros_visualise.sources.recordings.storage import Channel
from ros_visualise.sources.servers import Dialect, Received
from ros_visualise.sources.servers.foxglove import SUBPROTOCOLS, FoxgloveDialect
from ros_visualise.sources.servers.rosbridge import RosbridgeDialect

log = logging.getLogger(__name__)

_OPEN_S, _CLOSE_S, _LIST_S = 8.0, 0.5, 8.0
_SEND_S = 2  # then a server that does not read has failed
_SETTLED_S = 0.3  # topics are announced one after the other
_LOOK_S = 0.1
_BACK_OFF_S = (0.5, 10.0)
_MOST_WAITING = 2000
_SHARE = 32  # of the memory, for messages that wait
_MOST_NOTES = 20
_NUMBER = re.compile(r"\d+")
_MOST_TEXT = 4 << 20  # of definitions, which take half a minute to parse


class Connection:
    """Receives the messages of a server, on a thread of its own, until it is closed.

    It speaks the Foxglove WebSocket protocol if the server does, else rosbridge. If it fails, the
    same topics are subscribed to again as soon as the server is back.

    Args:
        address: ``ws://HOST:PORT``.

    Attributes:
        name: the address without a password.
        channels: the topics that the server offered at first.

    Raises:
        OpenError: no server, or none that lists its topics.
    """

    def __init__(self, address: str) -> None:
        self.name = without_secrets(address)
        self._address = address
        self._schemas = Schemas(_MOST_TEXT)
        self._changed, self._publishing = threading.Condition(), threading.Lock()
        self._waiting: deque[Received] = deque()
        self._waiting_bytes = 0
        self._dropped: Counter[str] = Counter()
        self._said: set[str] = set()
        self._received = 0
        self._closed = self._is_lost = False
        self._socket: ClientConnection | None = None
        self._dialect: Dialect | None = None
        self._wanted: Mapping[str, Channel] = {}
        self.channels: Mapping[str, Channel] = {}
        try:
            self._open()
            self._await_list()
        except Unreachable as error:
            self.close()
            raise OpenError(f"{self.name}: {error}") from None
        except BaseException:
            self.close()
            raise
        assert self._dialect is not None
        self.channels = dict(sorted(self._dialect.channels.items()))

    def start(self, topics: Collection[str]) -> None:
        """Subscribe to these topics of `channels`."""
        self._wanted = {topic: self.channels[topic] for topic in topics}
        supervision.start(f"server {self.name}", self._watch)

    def messages(self) -> Iterator[Received | None]:
        """The messages, or None after a while without one, until it is closed."""
        while not self._closed:
            with self._changed:
                if not self._waiting:
                    self._changed.wait(_LOOK_S)
                received = self._waiting.popleft() if self._waiting else None
                self._waiting_bytes -= received.message.nbytes if received else 0
            yield received

    def publish(self, topic: str, message: Recorded) -> None:
        """Publish a message at the server; from any thread.

        Raises:
            DamagedMessage: the server cannot take this type.
            Unreachable: the server has left, or does not accept messages.
        """
        opened, dialect = self._socket, self._dialect
        if opened is None or dialect is None:
            raise Unreachable(f"{self.name}: not connected")
        if not dialect.accepts:
            raise Unreachable(f"{self.name}: does not accept messages")
        try:
            with self._publishing:
                for frame in dialect.publish(topic, message):
                    opened.send(frame)
        except (ConnectionClosed, OSError):
            raise Unreachable(f"{self.name}: the connection was lost") from None

    def report(self) -> dict[str, int]:
        """Dropped messages by the reason."""
        with self._changed:
            return dict(self._dropped)

    def close(self) -> None:
        """End it; safe to call from any thread, and twice."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        if self._socket is not None:
            self._socket.close()

    def _open(self) -> None:
        """Connect; raises Unreachable."""
        try:
            opened = connect(
                self._address,
                subprotocols=[Subprotocol(one) for one in SUBPROTOCOLS],
                compression=None,
                open_timeout=_OPEN_S,
                close_timeout=_CLOSE_S,
                max_size=unpacked_limit(0),
            )
        except (OSError, InvalidHandshake, InvalidURI, EOFError) as error:
            reason = "no answer" if isinstance(error, TimeoutError) else str(error)
            raise Unreachable(f"cannot connect: {reason}") from None
        _limit_sending(opened)
        self._socket = opened
        is_foxglove = opened.subprotocol in SUBPROTOCOLS
        made = FoxgloveDialect if is_foxglove else RosbridgeDialect
        self._dialect = made(self._schemas)
        try:
            for frame in self._dialect.begin():
                opened.send(frame)
        except ConnectionClosed as error:
            raise Unreachable(self._reason(error)) from None

    def _await_list(self) -> None:
        """Wait until the server has listed its topics; raises Unreachable."""
        assert self._dialect is not None
        end_s = time.monotonic() + _LIST_S
        known = -1
        try:
            while time.monotonic() < end_s and known != len(self._dialect.channels):
                known = len(self._dialect.channels) if self._dialect.is_listed else -1
                self._hear(_SETTLED_S)
        except ConnectionClosed as error:
            raise Unreachable(self._reason(error)) from None
        self._report_notes()
        if not self._dialect.channels:
            raise Unreachable("it offers no topics; start the nodes that publish them")

    def _watch(self) -> None:
        """The thread: receive, and connect again after a while, until it is closed."""
        shortest_s, longest_s = _BACK_OFF_S
        delay_s = shortest_s
        try:
            while not self._closed:
                received = self._received
                reason = self._receive()
                self._socket = None
                is_better = self._received > received
                delay_s = shortest_s if is_better else min(2 * delay_s, longest_s)
                if not (self._closed or self._is_lost):
                    log.warning("%s: %s; trying again", self.name, reason)
                    self._is_lost = True
                with self._changed:
                    self._changed.wait_for(lambda: self._closed, delay_s)
        finally:
            self.close()

    def _receive(self) -> str:
        """Receive until it fails; returns why."""
        try:
            if self._socket is None:
                self._open()
            next_s = 0.0
            while not self._closed:
                if time.monotonic() >= next_s:
                    self._follow()
                    next_s = time.monotonic() + _LOOK_S
                self._hear(_LOOK_S)
        except Unreachable as error:
            return str(error)
        except (ConnectionClosed, OSError) as error:
            return self._reason(error)
        finally:
            if self._socket is not None:
                self._socket.close()
        return "closed"

    def _follow(self) -> None:
        """Subscribe to wanted topics that the server offers by now."""
        assert self._dialect is not None
        assert self._socket is not None
        for frame in self._dialect.follow(self._wanted):
            self._socket.send(frame)
        self._report_notes()

    def _hear(self, timeout_s: float) -> None:
        """Take the next frame, if one comes in time."""
        assert self._dialect is not None
        assert self._socket is not None
        try:
            frame = self._socket.recv(timeout_s)
        except TimeoutError:
            return
        try:
            found = self._dialect.hear(frame, time.time_ns())
        except DamagedMessage as error:
            with self._changed:
                self._dropped["damaged"] += 1
            self._report(f"a message was dropped: {error}")
            return
        if found is not None:
            self._put(found)

    def _put(self, received: Received) -> None:
        with self._changed:
            self._received += 1
            self._waiting.append(received)
            self._waiting_bytes += received.message.nbytes
            most_bytes = max_memory() // _SHARE
            while len(self._waiting) > _MOST_WAITING or self._waiting_bytes > most_bytes:
                self._waiting_bytes -= self._waiting.popleft().message.nbytes
                self._dropped["queue"] += 1
            self._changed.notify_all()
        if self._is_lost:
            self._is_lost = False
            log.info("%s: connection restored", self.name)

    def _report_notes(self) -> None:
        assert self._dialect is not None
        for note in self._dialect.notes:
            self._report(f"the server reports: {note}")
        self._dialect.notes = []
        late = self._dialect.channels.keys() - self.channels.keys()
        if self.channels and late:
            self._report(
                f"new topics, not shown: {', '.join(sorted(late)[:3])}; reopen to show them"
            )

    def _report(self, text: str) -> None:
        """Log a text, once, whatever numbers it has."""
        kind = _NUMBER.sub("0", text)
        if kind not in self._said and len(self._said) < _MOST_NOTES:
            self._said.add(kind)
            log.warning("%s: %s (further occurrences suppressed)", self.name, text)

    def _reason(self, error: Exception) -> str:
        sent = error.sent if isinstance(error, ConnectionClosed) else None
        if sent is not None and sent.code == 1009:
            limit = sized(unpacked_limit(0))
            return f"sent more than {limit} at once; if you trust it, raise --max-memory"
        return "the connection was lost"


def _limit_sending(connection: ClientConnection) -> None:
    """Let a server that reads nothing block a sender, and with it the end, only for a while."""
    with suppress(OSError):  # where the system has another form of it
        limit = struct.pack("ll", _SEND_S, 0)
        connection.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, limit)

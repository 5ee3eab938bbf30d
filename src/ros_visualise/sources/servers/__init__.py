"""Live messages of servers on the network: the Foxglove WebSocket protocol and rosbridge.

A `Dialect` is a protocol; `Connection` holds the connection, and opens it again when it fails.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple, Protocol

from ros_visualise.messages.recorded import Recorded
from ros_visualise.sources.recordings.storage import Channel

_ADDRESS = re.compile(r"wss?://\S+", re.IGNORECASE)

LONGEST_NAME = 256
"""Letters of a topic; longer ones are not shown."""

Frame = str | bytes


class Received(NamedTuple):
    """A message of a server, and its topic."""

    topic: str
    message: Recorded


class Dialect(Protocol):
    """One connection's side of a protocol; every call comes from one thread.

    Attributes:
        channels: what the server offers, by topic; of several alike the first.
        is_listed: True once the server has listed its topics.
        notes: what its user should know, such as reasons why topics cannot be listed.
        accepts: True if it takes messages.
    """

    channels: dict[str, Channel]
    is_listed: bool
    notes: list[str]
    accepts: bool

    def begin(self) -> Iterator[Frame]:
        """Frames to send first."""

    def follow(self, topics: Mapping[str, Channel]) -> Iterator[Frame]:
        """Frames that subscribe to those of these topics that are not subscribed to."""

    def hear(self, frame: Frame, now_ns: int) -> Received | None:
        """The message in a frame of the server; None for one that is about something else.

        Raises:
            DamagedMessage: it is malformed.
        """

    def publish(self, topic: str, message: Recorded) -> Iterator[Frame]:
        """Frames that publish a message.

        Raises:
            DamagedMessage: the server cannot take this type.
        """


def is_server(address: str) -> bool:
    """True for the address of a server of messages: ``ws://HOST:PORT``."""
    return bool(_ADDRESS.fullmatch(address))

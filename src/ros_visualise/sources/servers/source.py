"""The source of a graph that a server of live messages is."""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from ros_visualise.core.declarations import completed
from ros_visualise.core.errors import UsageError, did_you_mean
from ros_visualise.messages.qos import LATCHED, VOLATILE
from ros_visualise.messages.recorded import Recorded, TopicType
from ros_visualise.sources.declarations import Source, SourceType
from ros_visualise.sources.playback import Playback
from ros_visualise.sources.recordings.storage import Channel
from ros_visualise.sources.servers.connection import Connection

log = logging.getLogger(__name__)

_LISTED = 3  # of topics that cannot be shown, so many are named


@dataclass(frozen=True)
class ServerParams:
    """A server has no parameters."""


class ServerSource:
    """The live messages of a server; what it lacks of a `Source` has its defaults."""

    def __init__(self, connection: Connection, topics: Collection[str], playback: Playback) -> None:
        self._connection, self._playback = connection, playback
        connection.start(topics)

    def messages(self) -> Iterator[tuple[str, Any]]:
        """The messages of the server."""
        yield from self._playback.follow(self._connection.messages())

    def report(self) -> dict[str, Any]:
        """Dropped messages."""
        return {"dropped": self._connection.report()}

    def publish(self, topic: str, message: Recorded) -> None:
        """Publish a message at the server."""
        self._connection.publish(topic, message)

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()


def server_source(connection: Connection, topics: Collection[str] = ()) -> SourceType:
    """A source with an output for each topic of a server, of the same name.

    Args:
        connection: it is open; the source closes it.
        topics: these alone; none: all that can be read.

    Raises:
        UsageError: a topic is missing or unreadable, or all are.
    """
    types = {topic: _type_of(channel) for topic, channel in _played(connection, topics).items()}
    return SourceType(
        "server",
        lambda _, playback: completed(ServerSource, Source)(connection, types, playback),
        ServerParams,
        {topic: kind.data_class for topic, kind in types.items()},
        live=True,
        doc="Messages from a server.",
        latched=frozenset(topic for topic, kind in types.items() if kind.qos.transient_local),
        ros=types,
        publishes=True,
    )


def _type_of(channel: Channel) -> TopicType:
    is_latched = channel.topic.endswith("/tf_static")
    return TopicType(channel.type_name, channel.definitions, LATCHED if is_latched else VOLATILE)


def _played(connection: Connection, wanted: Collection[str]) -> Mapping[str, Channel]:
    channels = connection.channels
    for topic in wanted:
        if topic not in channels:
            raise UsageError(f"no topic {topic}{did_you_mean(topic, channels)}")
        if channels[topic].unreadable:
            raise UsageError(f"{topic} cannot be shown: {channels[topic].unreadable}")
    unreadable = [
        f"{topic} ({one.unreadable})" for topic, one in channels.items() if one.unreadable
    ]
    more = f" and {len(unreadable) - _LISTED} more" if len(unreadable) > _LISTED else ""
    text = "; ".join(unreadable[:_LISTED]) + more
    found = {
        topic: channel
        for topic, channel in channels.items()
        if not channel.unreadable and (not wanted or topic in wanted)
    }
    if not found:
        raise UsageError(f"{connection.name}: no topic can be shown: {text}")
    if unreadable and not wanted:
        log.warning("%s: not shown: %s", connection.name, text)
    return found

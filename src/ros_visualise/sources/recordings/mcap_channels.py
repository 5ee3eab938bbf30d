"""What the channels and schemas of an MCAP file say of its topics.

Source: mcap.dev/spec/registry, the profiles ``ros1`` and ``ros2`` and their encodings.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from mcap.records import Channel as McapChannel
from mcap.records import Schema

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.messages.definitions import Encoding
from ros_visualise.sources.recordings.schemas import Schemas, digest, is_latched, ros_name
from ros_visualise.sources.recordings.storage import Channel

_ENCODINGS: Mapping[str, Encoding] = {"ros1": "ros1", "cdr": "cdr"}
_LANGUAGES = {"ros1": ("ros1msg",), "cdr": ("ros2msg", "ros2idl")}
_UNDERSTOOD = ("callerid", "latching", "md5sum", "offered_qos_profiles", "topic_type_hash")


def describe(channel: McapChannel, schema: Schema | None, schemas: Schemas) -> Channel:
    """A channel of an MCAP file as its messages are to be read.

    Args:
        schema: its own, if the file has it.
        schemas: those of the recording, to which it is added.
    """
    encoding = channel.message_encoding
    if encoding not in _LANGUAGES:
        why = f"{encoding or 'no encoding'}: only ROS messages are read"
    elif schema is None:
        why = f"{encoding}: it has no schema"
    else:
        return _ros_channel(channel, schema, schemas)
    return Channel(channel.topic, schema.name if schema else "", unreadable=why)


def _ros_channel(channel: McapChannel, schema: Schema, schemas: Schemas) -> Channel:
    encoding = channel.message_encoding
    name = ros_name(schema.name)
    found = Channel(
        channel.topic,
        name,
        latched=_is_latched(channel),
        offered_qos=channel.metadata.get("offered_qos_profiles", ""),
        callerid=channel.metadata.get("callerid", ""),
        labels=tuple(pair for pair in channel.metadata.items() if pair[0] not in _UNDERSTOOD),
    )
    if schema.encoding not in _LANGUAGES[encoding]:
        why = f"{schema.encoding or 'no schema'}: only ROS's own definitions are read"
        return replace(found, unreadable=why)
    is_idl = schema.encoding == "ros2idl"
    text = schema.data.decode("utf-8", "replace")
    try:
        definitions = schemas.define(_ENCODINGS[encoding], name, text, is_idl)
    except DamagedMessage as damage:
        if is_idl:
            return replace(found, unreadable=str(damage))
        given, why = _given_digest(channel), str(damage)
        kept = schemas.keep(_ENCODINGS[encoding], name, text, given, why)
        return replace(found, definitions=kept, digest=given, unreadable=why)
    told = _given_digest(channel) or digest(definitions, name)
    return replace(found, definitions=definitions, digest=told)


def _given_digest(channel: McapChannel) -> str:
    return channel.metadata.get("topic_type_hash") or channel.metadata.get("md5sum") or ""


def _is_latched(channel: McapChannel) -> bool:
    if channel.metadata.get("latching", "0").lower() in ("1", "true"):
        return True
    return is_latched(channel.metadata.get("offered_qos_profiles", ""))

"""Key expressions, tokens and attachments, as rmw_zenoh has them.

A topic has the key ``DOMAIN/NAME/TYPE/HASH``. Each node, publisher, subscriber and service keeps a
liveliness token, whose key says all about it; by those peers know the graph. Live parameters have a
key and a token of ours beside them. Each message has an attachment: its number, the time and the
publisher's id.

Source: the design document of rmw_zenoh, ``docs/design.md`` in ros2/rmw_zenoh.
"""

from __future__ import annotations

import hashlib
import os
import re
import struct
import time
from typing import NamedTuple

from ros_visualise.messages.qos import QoS

NODE, PUBLISHER, SUBSCRIBER, SERVICE, PARAMETERS = "NN", "MP", "MS", "SS", "PS"

TRIGGER = (
    "std_srvs/srv/Trigger",
    "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
)
SET_CAMERA_INFO = (
    "sensor_msgs/srv/SetCameraInfo",
    "RIHS01_a10cca5d33dc637c8d49db50ab288701a3592bb9cd854f2f16a0659613b68984",
)
"""Types of services, with their hashes in ROS 2 Jazzy."""

DOMAIN = os.environ.get("ROS_DOMAIN_ID") or "0"
GRAPH = f"@ros2_lv/{DOMAIN}/**"
OWN_GRAPH = f"@ros_visualise/{DOMAIN}/**"
"""Keys of all tokens: those of rmw_zenoh, and those of nodes with live parameters."""

_ILLEGAL = re.compile(r"[*$?#%@\s\x00-\x1f\x7f]")
_TYPE = re.compile(r"(\w+)/(msg|srv|action)/(\w+)")
_MANGLED_TYPE = re.compile(r"(\w+)::(msg|srv|action)::dds_::(\w+)_")
_LONGEST = 2048
_PARTS = 13
_ATTACHMENT = struct.Struct("<qqB16s")
_RESTART = 1_000_000  # a longer step is no gap
_MOST_PUBLISHERS = 1000


class Entity(NamedTuple):
    """A node, publisher, subscriber, service or set of parameters, as its token says it.

    Attributes:
        kind: NODE, PUBLISHER, SUBSCRIBER, SERVICE or PARAMETERS.
        session: id of the process's session.
        node: the node's full name.
        name: full name of the topic or service, or of what has the parameters.
        type: as ``sensor_msgs/msg/Image``.
    """

    kind: str
    session: str
    node: str
    name: str = ""
    type: str = ""


def legal(name: str) -> str:
    """A full name as a key can have it; names of recordings may have other letters."""
    return re.sub("/+", "/", _ILLEGAL.sub("_", name)).rstrip("/") or "/"


def topic_key(name: str, type: str, digest: str) -> str:
    """Key of a topic or a service; ``*`` as the digest: whatever the version of the type."""
    return f"{DOMAIN}/{name.strip('/')}/{_mangled_type(type)}/{digest}"


def parameters_key(place: str) -> str:
    """Key of the live parameters of a node, by its full name."""
    return f"{DOMAIN}/{place.strip('/')}/@parameters"


def token(entity: Entity, number: int, digest: str = "", qos: QoS | None = None) -> str:
    """Key of an entity's liveliness token.

    Args:
        entity: what it says.
        number: of the entity in its session.
        digest: hash of its type.
        qos: of a topic; none: the default.
    """
    namespace, _, node = entity.node.rpartition("/")
    where = f"{DOMAIN}/{entity.session}/0/{number}/{entity.kind}/%/{_mangled(namespace)}/{node}"
    if entity.kind == PARAMETERS:
        return f"@ros_visualise/{where}/{_mangled(entity.name)}"
    if entity.kind == NODE:
        return f"@ros2_lv/{where}"
    type = _mangled_type(entity.type)
    return f"@ros2_lv/{where}/{_mangled(entity.name)}/{type}/{digest}/{_qos(qos or QoS())}"


def parse(key: str) -> Entity | None:
    """The entity of a token's key; None if it is none, or none that matters here."""
    if len(key) > _LONGEST:
        return None
    parts = key.split("/")
    if not 9 <= len(parts) <= _PARTS or parts[0] not in ("@ros2_lv", "@ros_visualise"):
        return None
    if not all(parts) or any(part[0] != "%" for part in parts[7:10:2]):
        return None
    session, kind = parts[2], parts[5]
    node = f"{_plain(parts[7]).rstrip('/')}/{parts[8]}"
    if kind == NODE and len(parts) == 9:
        return Entity(kind, session, node)
    if kind == PARAMETERS and len(parts) == 10:
        return Entity(kind, session, node, _plain(parts[9]))
    found = _MANGLED_TYPE.fullmatch(parts[10]) if len(parts) == _PARTS else None
    if found is None or kind not in (PUBLISHER, SUBSCRIBER, SERVICE):
        return None
    return Entity(kind, session, node, _plain(parts[9]), "/".join(found.groups()))


class Attachments:
    """Attachments of one publisher's messages: number, time and id.

    Args:
        token: key of its token.
    """

    def __init__(self, token: str) -> None:
        self._gid = hashlib.md5(token.encode(), usedforsecurity=False).digest()
        self._number = 0

    def next(self) -> bytes:
        """Attachment of the next message."""
        self._number += 1
        return _ATTACHMENT.pack(self._number, time.time_ns(), len(self._gid), self._gid)


class Gaps:
    """Messages of a topic that never arrived, by the numbers of those that did.

    Attributes:
        missing: their count, over all publishers.
    """

    def __init__(self) -> None:
        self.missing = 0
        self._newest: dict[bytes, int] = {}

    def take(self, attachment: bytes) -> None:
        """Take the attachment of a message; a malformed one counts for nothing."""
        if len(attachment) != _ATTACHMENT.size:
            return
        number, _, _, gid = _ATTACHMENT.unpack(attachment)
        step = number - self._newest.pop(gid, number - 1)
        if 1 < step < _RESTART:
            self.missing += step - 1
        elif -_RESTART < step < 0:  # one that was latched, after newer ones
            self.missing -= self.missing > 0
            number -= step
        self._newest[gid] = number
        if len(self._newest) > _MOST_PUBLISHERS:
            del self._newest[next(iter(self._newest))]


def _qos(qos: QoS) -> str:
    """QoS as a token has it: the fields that differ from rmw_zenoh's default."""
    reliable, latched = "" if qos.reliable else "2", "1" if qos.transient_local else ""
    return f"{reliable}:{latched}:,{qos.depth}:,:,:,,"


def _mangled_type(type: str) -> str:
    return _TYPE.sub(r"\1::\2::dds_::\3_", type)


def _mangled(name: str) -> str:
    return name.replace("/", "%") or "%"


def _plain(mangled: str) -> str:
    return mangled.replace("%", "/")

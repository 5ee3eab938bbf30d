"""Encoding of messages from any source."""

from __future__ import annotations

import logging
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from rosbags.convert.converter import (
    LATCH,
    STATIC_MSGTYPE_RENAMES,
    is_same_wireformat,
    migrate_bytes,
)
from rosbags.interfaces import Nodetype, QosDurability, QosHistory, QosReliability
from rosbags.rosbag2.metadata import dump_qos_v8, parse_qos

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.core.yaml_files import BadYaml, parse_yaml
from ros_visualise.data import CompressedImage, Image, Message, Path
from ros_visualise.data.fields import Fields, build
from ros_visualise.messages import data_class, from_message, to_message
from ros_visualise.messages.definitions import Definitions, Encoding, Undecoded, parts_of
from ros_visualise.messages.misfits import refused
from ros_visualise.messages.path_bytes import pose_bytes
from ros_visualise.messages.qos import VOLATILE, QoS
from ros_visualise.messages.recorded import Recorded, TopicType

log = logging.getLogger(__name__)

Buffer = bytes | memoryview
_About = tuple[Any, Any]
_Convert = Callable[[Buffer], Buffer]
_THREE_PARTS = re.compile(r"^(MSG: )?(\w+)/(?:msg|action|srv)/(\w+)", re.MULTILINE)
_ROS = {"ros1": "ROS 1", "cdr": "ROS 2"}


@dataclass(frozen=True)
class TopicDeclaration:
    """A topic as declared in a file.

    ``name`` is its type as ``sensor_msgs/msg/Image``, ``text`` the whole definition of that,
    ``digest`` its MD5 or hash.
    """

    name: str
    text: str
    digest: str
    topic: TopicType

    @property
    def offered_qos(self) -> str:
        """QoS profiles of the publishers as YAML: those of its recording, else of `TopicType.qos`.

        Empty for ROS's default. ``ros2 bag play`` uses them to offer latched topics.
        """
        return self.topic.offered_qos or qos_profile(self.topic.qos)


class Encoder:
    """Writes messages in one encoding; recorded ones of that encoding keep their bytes.

    Recorded messages of the other encoding are rewritten by the rosbags library: byte by byte where
    ROS 1 and ROS 2 define a type alike, else field by field. Types that only their recording knows
    are defined in the other encoding too.
    """

    def __init__(self, encoding: Encoding) -> None:
        self.encoding: Encoding = encoding
        self._own = Definitions(encoding)
        self._conversions: dict[tuple[str, Definitions], _Convert] = {}
        self._defaults: dict[str, object] = {}

    def declare(self, topic: TopicType) -> TopicDeclaration:
        """The declaration of a topic in a file.

        Raises:
            DamagedMessage: this encoding cannot store such a type.
        """
        source, name = topic.definitions, topic.name
        is_copied = isinstance(source, Undecoded) and source.encoding == self.encoding
        if source is not None and not is_copied and not source.knows(name):
            raise DamagedMessage(f"{name}: unknown type")
        if source is not None and source.encoding != self.encoding:
            self._conversion(source, name)
            source, name = None, self._rename(name)
        types = source or self._own
        if not is_copied and not types.knows(name):
            raise DamagedMessage(f"{name}: unknown type")
        try:
            text, digest = types.text(name), types.digest(name)
        except (AssertionError, KeyError) as error:  # the library has no such names or types
            raise DamagedMessage(f"{name}: {_ROS[self.encoding]} cannot hold this type") from error
        if self._is_ros1:
            text = _THREE_PARTS.sub(r"\1\2/\3", text)
        return TopicDeclaration(self._rename(name), text, digest, topic)

    def encode(self, message: Any) -> Buffer:
        """The bytes of one of `ros_visualise.data` or of a `Recorded`.

        Raises:
            DamagedMessage: this encoding cannot store a value, such as a stamp before 1970 or an
                int in place of a string; or a recorded message is damaged or cannot be converted.
                No other error is raised, whatever the message is.
        """
        if isinstance(message, Recorded):
            return self._encode_recorded(message)
        try:
            return self._encode(message)
        except Exception as error:  # the library raises what it happens to meet
            raise refused(message, error, self._own.store) from error

    def _encode_recorded(self, message: Recorded) -> Buffer:
        if message.definitions.encoding == self.encoding:
            return message.data
        convert = self._conversion(message.definitions, message.type_name)
        try:
            return convert(message.data)
        except DamagedMessage:
            raise
        except Exception as error:  # the library raises what it happens to meet
            raise DamagedMessage(
                f"{message.type_name}: a message cannot be converted to {_ROS[self.encoding]}"
            ) from error

    def parts(self, message: Any) -> list[Buffer]:
        """The same bytes as of `encode`, in parts, with pixels not copied.

        Raises:
            DamagedMessage: as `encode`.
        """
        if not isinstance(message, Image | CompressedImage):
            return [self.encode(message)]
        try:
            return self._image_parts(message)
        except Exception as error:  # as in `encode`
            raise refused(message, error, self._own.store) from error

    def _image_parts(self, message: Image | CompressedImage) -> list[Buffer]:
        fields = message.fields()
        data = fields["data"]
        empty = Fields(message.type_name, {**fields, "data": data[:0]})
        written = bytes(self._own.write(message.type_name, build(empty, self._own.types)))
        return [written[:-4] + len(data).to_bytes(4, "little"), data.data]

    def _encode(self, message: Any) -> Buffer:
        if isinstance(message, Path):
            return self._encode_path(message)
        if isinstance(message, Image | CompressedImage):
            return b"".join(self._image_parts(message))
        return self._own.write(message.type_name, to_message(message, self._own.types))

    def _encode_path(self, path: Path) -> bytes:
        """Equal to the bytes of the library, which makes an object of every pose."""
        empty = Path(path.stamps_ns[:0], path.positions_xyz[:0], path.quats_xyzw[:0])
        message = to_message(empty, self._own.types, path.header)
        written = bytes(self._own.write(Path.type_name, message))
        count = len(path.stamps_ns).to_bytes(4, "little")
        start = len(written) - (4 if self.encoding == "cdr" else 0)
        return written[:-4] + count + pose_bytes(path, self.encoding, start)

    def _rename(self, name: str) -> str:
        """A type's name in this encoding; ROS 1 lacks names for parts of actions and services."""
        if self._is_ros1:
            return _THREE_PARTS.sub(r"\2/msg/\3", name)
        return STATIC_MSGTYPE_RENAMES.get(name, name)

    def _conversion(self, source: Definitions, name: str) -> _Convert:
        key = name, source
        if key not in self._conversions:
            target = self._rename(name)
            try:
                self._adopt(source, name)
                self._conversions[key] = self._make_conversion(source, name, target)
            except Exception as error:  # the library raises what it happens to meet
                reason = f"{name}: {_ROS[self.encoding]} cannot hold this type"
                raise DamagedMessage(reason) from error
        return self._conversions[key]

    def _adopt(self, source: Definitions, name: str) -> None:
        """Define an unknown type in this encoding, and the types of its fields."""
        own, given = self._own.store, source.store.fielddefs
        found: dict[str, Any] = {}
        left = [name]
        while left:
            one = left.pop()
            target = self._rename(one)
            if target not in own.fielddefs and target not in found:
                constants, fields = given[one]
                found[target] = constants, [(f, self._adapt(about)) for f, about in fields]
                left += parts_of(fields)
        own.register(found)

    def _adapt(self, about: _About) -> _About:
        """A field's type in this encoding; ROS 1 has no bounds."""
        kind, content = about
        if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            element, size = content
            size = 0 if self._is_ros1 and kind == Nodetype.SEQUENCE else size
            return kind, (self._adapt(element), size)
        if kind == Nodetype.NAME:
            return kind, self._rename(content)
        name, bound = content
        return kind, (name, 0 if self._is_ros1 else bound)

    def _make_conversion(self, source: Definitions, name: str, target: str) -> _Convert:
        own = self._own.store
        migrate = partial(
            _migrate, source.store, own, name, target, self._defaults, to_ros1=self._is_ros1
        )
        if not is_same_wireformat(source.store, own, name, target):
            kind = data_class(name)
            if kind is not None and kind.renamed and kind.type_name == name:
                return partial(self._rewrite, source, name, kind)
            log.info("%s differs between ROS 1 and ROS 2; copying fields by name", name)
            return migrate
        if self._is_ros1:
            direct = partial(source.store.cdr_to_ros1, typename=name)
            return lambda data: direct(data) if data[1] & 1 else migrate(data)  # little-endian only
        return partial(own.ros1_to_cdr, typename=target)

    def _rewrite(self, source: Definitions, name: str, kind: type[Message], data: Buffer) -> Buffer:
        """Decode a message to one of ours and encode that."""
        return self.encode(from_message(source.read(name, data), kind))

    @property
    def _is_ros1(self) -> bool:
        return self.encoding == "ros1"


def _migrate(
    source: Any,
    own: Any,
    name: str,
    target: str,
    defaults: dict[str, object],
    data: Buffer,
    to_ros1: bool,
) -> Buffer:
    return migrate_bytes(
        source, own, name, target, defaults, data, src_is2=to_ros1, dst_is2=not to_ros1
    )


def qos_profile(qos: QoS) -> str:
    """QoS profile of one publisher, as YAML; empty for ROS's default."""
    if qos == VOLATILE:
        return ""
    found = LATCH[0]._replace(
        history=QosHistory.KEEP_LAST,
        depth=qos.depth,
        reliability=QosReliability.RELIABLE if qos.reliable else QosReliability.BEST_EFFORT,
        durability=QosDurability.TRANSIENT_LOCAL if qos.transient_local else QosDurability.VOLATILE,
    )
    return dump_qos_v8([found])


def numbered_qos(profiles: str) -> str:
    """QoS profiles with numbers for words, as in ``metadata.yaml``; empty if damaged."""
    try:
        return dump_qos_v8(parse_qos(parse_yaml(profiles.encode())))
    except (BadYaml, LookupError, TypeError, ValueError, AttributeError):
        return ""

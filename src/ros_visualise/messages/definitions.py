"""The message types of one recording: how its bytes are read and written."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from ros_visualise.core.errors import DamagedMessage, TooLarge
from ros_visualise.messages.bounded import BoundedStore, check_definition

Encoding = Literal["ros1", "cdr"]
"""Encoding of messages: that of ROS 1, or plain CDR of ROS 2."""

_STORES = {"ros1": Stores.ROS1_NOETIC, "cdr": Stores.ROS2_JAZZY}
Stamped = Literal["", "first", "inner"]
"""Stamps of messages: none, that of the header that they begin with, or further ones inside."""

_HEADER, _TIME = "std_msgs/msg/Header", "builtin_interfaces/msg/Time"
_TIMES = {_HEADER, _TIME, "builtin_interfaces/msg/Duration"}
_TEXTS = {"string", "wstring"}

_TF = {"tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms"}

_BOX_2D = "center\nfloat64 size_x\nfloat64 size_y"
_BOX_3D = "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size"
_RESULTS = "std_msgs/Header header\nObjectHypothesisWithPose[] results\n"
_POSE = "geometry_msgs/PoseWithCovariance pose"

_VISION = {
    "vision_msgs/msg/VisionInfo": (
        "std_msgs/Header header\nstring method\nstring database_location\nint32 database_version"
    ),
    "vision_msgs/msg/BoundingBox3D": _BOX_3D,
    "vision_msgs/msg/Detection2DArray": "std_msgs/Header header\nDetection2D[] detections",
    "vision_msgs/msg/Detection3DArray": "std_msgs/Header header\nDetection3D[] detections",
}

_VISION_1 = {
    "vision_msgs/msg/ObjectHypothesis": "int64 id\nfloat64 score",
    "vision_msgs/msg/ObjectHypothesisWithPose": f"int64 id\nfloat64 score\n{_POSE}",
    "vision_msgs/msg/BoundingBox2D": f"geometry_msgs/Pose2D {_BOX_2D}",
    "vision_msgs/msg/Detection2D": f"{_RESULTS}BoundingBox2D bbox\nsensor_msgs/Image source_img",
    "vision_msgs/msg/Detection3D": (
        f"{_RESULTS}BoundingBox3D bbox\nsensor_msgs/PointCloud2 source_cloud"
    ),
}
"""vision_msgs 0.0.2, for ROS 1."""

_VISION_2 = {
    "vision_msgs/msg/Point2D": "float64 x\nfloat64 y",
    "vision_msgs/msg/Pose2D": "vision_msgs/Point2D position\nfloat64 theta",
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score",
    "vision_msgs/msg/ObjectHypothesisWithPose": f"ObjectHypothesis hypothesis\n{_POSE}",
    "vision_msgs/msg/BoundingBox2D": f"vision_msgs/Pose2D {_BOX_2D}",
    "vision_msgs/msg/Detection2D": f"{_RESULTS}BoundingBox2D bbox\nstring id",
    "vision_msgs/msg/Detection3D": f"{_RESULTS}BoundingBox3D bbox\nstring id",
}
"""vision_msgs 4, for ROS 2 from Humble on."""

_ADDED_TYPES = {"ros1": {**_TF, **_VISION_1, **_VISION}, "cdr": {**_VISION_2, **_VISION}}
"""Types that the library does not know by itself: encoding -> type name -> definition."""

_LONGEST = 256 << 10  # the library parses 100 KiB in a second; the longest real ones have that
_COMMENT = re.compile(r"\s*#")
_BOUND = re.compile(r"^(\s*string)<=\d+(?=\s+[A-Z]\w*\s*=)", re.MULTILINE)
_EMPTY = re.compile(r"^(\s*string\s+[A-Z]\w*\s*=)[ \t]*$", re.MULTILINE)


def parse(text: str, type_name: str) -> dict[str, Any]:
    """The types of a definition, as a typestore's ``fielddefs`` has them.

    Raises:
        Exception: not a valid definition; the library's parser raises various exceptions.
    """
    # the library is slow with comments, and rejects bounded or empty constants
    lines = [line for line in text.split("\n") if line.strip() and not _COMMENT.match(line)]
    text = _EMPTY.sub(r'\1 ""', _BOUND.sub(r"\1", "\n".join(lines) + "\n"))
    check_length(text)
    return dict(get_types_from_msg(text, type_name))


def check_length(text: str) -> None:
    """Check the length of a definition before it is parsed.

    Raises:
        TooLarge: parsing would take long.
    """
    if len(text) > _LONGEST:
        raise TooLarge(f"its definition is longer than {_LONGEST >> 10} KiB")


def parts_of(fields: Iterable[tuple[str, Any]]) -> set[str]:
    """Types of fields, which are given as in a typestore's ``fielddefs``."""
    return {name for kind, name in _items(fields) if kind == Nodetype.NAME}


def has_strings(fields: Iterable[tuple[str, Any]]) -> bool:
    """True if one of these fields is a string or holds several."""
    return any(kind == Nodetype.BASE and base[0] == "string" for kind, base in _items(fields))


def _items(fields: Iterable[tuple[str, Any]]) -> Iterator[Any]:
    """Types of fields, and of the items of arrays."""
    return (d[1][0] if d[0] in (Nodetype.ARRAY, Nodetype.SEQUENCE) else d for _, d in fields)


class Definitions:
    """The types of ROS 1 or ROS 2 and those that a recording defines; thread-safe.

    Types are written ``package/msg/Name``.
    """

    def __init__(self, encoding: Encoding) -> None:
        self.encoding: Encoding = encoding
        self._given: dict[str, str] = {}
        self._starts_with_header: dict[str, bool] = {}
        self._stamped: dict[str, Stamped] = {}
        self._lock = threading.RLock()
        self._made: BoundedStore | None = None

    @property
    def _store(self) -> BoundedStore:
        """Created when it is needed, which takes a fifth of a second."""
        if self._made is None:
            with self._lock:
                self._made = self._made or _make_store(self.encoding)
        return self._made

    @property
    def types(self) -> Mapping[str, Any]:
        """Type name -> class, for `ros_visualise.messages.to_message`."""
        return self._store.types

    @property
    def store(self) -> Typestore:
        """The typestore of the library."""
        return self._store

    def define(self, type_name: str, text: str) -> None:
        """Add a type and its parts from a definition; they take precedence over those of ROS.

        Raises:
            DamagedMessage: not a valid definition.
        """
        with self._lock:
            if self._given.get(type_name) == text:
                return
            try:
                found = parse(text, type_name)
                check_definition(type_name, {**self._store.fielddefs, **found})
                changed = {n: t for n, t in found.items() if self._store.fielddefs.get(n) != t}
                for name in changed:
                    self._store.fielddefs.pop(name, None)
                self._store.register(changed)
                self._store.forget()
            except TooLarge as error:
                raise DamagedMessage(f"{type_name}: {error}") from error
            except Exception as error:  # the library's parser raises various exceptions
                raise DamagedMessage(f"{type_name}: its definition cannot be read") from error
            self._given[type_name] = text
            self._starts_with_header.clear()
            self._stamped.clear()

    def knows(self, type_name: str) -> bool:
        """True if messages of that type can be read."""
        return type_name in self._store.fielddefs

    def read(self, type_name: str, data: bytes | memoryview) -> Any:
        """The message in the bytes.

        Raises:
            DamagedMessage: they are not one, or its type is unknown.
        """
        store = self._store
        read = store.deserialize_ros1 if self.encoding == "ros1" else store.deserialize_cdr
        try:
            return read(data, type_name)
        except TooLarge as error:
            raise DamagedMessage(f"{type_name}: {error}") from error
        except Exception as error:  # the library's readers raise various exceptions
            raise DamagedMessage(self._why(type_name, len(data))) from error

    def write(self, type_name: str, message: Any) -> memoryview:
        """The bytes of a message of one of `types`."""
        store = self._store
        write = store.serialize_ros1 if self.encoding == "ros1" else store.serialize_cdr
        return write(message, type_name)

    def text(self, type_name: str) -> str:
        """Whole definition of a type: that of the recording, else that of ROS."""
        if type_name in self._given:
            return self._given[type_name]
        text, _ = self._store.generate_msgdef(type_name, ros_version=self._version)
        return text

    def digest(self, type_name: str) -> str:
        """MD5 of a type in ROS 1, its RIHS01 hash in ROS 2."""
        if self.encoding == "cdr":
            return self._store.hash_rihs01(type_name)
        return self._store.generate_msgdef(type_name, ros_version=1)[1]

    def starts_with_header(self, type_name: str) -> bool:
        """True if messages of that type begin with a std_msgs/Header."""
        if type_name not in self._starts_with_header:
            self._starts_with_header[type_name] = self._looks_headed(type_name)
        return self._starts_with_header[type_name]

    def stamped(self, type_name: str) -> Stamped:
        """The stamps that messages of that type have."""
        if type_name not in self._stamped:
            _, fields = self._store.fielddefs.get(type_name, ([], []))
            is_headed = self.starts_with_header(type_name)
            first: Stamped = "first" if is_headed else ""
            self._stamped[type_name] = "inner" if self._has_stamp(fields[is_headed:]) else first
        return self._stamped[type_name]

    def numbers(self, type_name: str, most_deep: int = 6) -> Iterator[str]:
        """Paths of the numbers in messages of that type, without arrays, headers and times."""
        _, fields = self._store.fielddefs.get(type_name, ([], []))
        for name, (kind, found) in fields:
            if kind == Nodetype.BASE and found[0] not in _TEXTS:
                yield name
            elif isinstance(found, str) and found not in _TIMES and most_deep:
                yield from (f"{name}.{path}" for path in self.numbers(found, most_deep - 1))

    def _has_stamp(self, fields: Sequence[tuple[str, Any]]) -> bool:
        if ("stamp", (Nodetype.NAME, _TIME)) in fields:
            return True
        known = self._store.fielddefs
        return any(self._has_stamp(known[part][1]) for part in parts_of(fields) if part in known)

    @property
    def _version(self) -> Literal[1, 2]:
        return 1 if self.encoding == "ros1" else 2

    def _looks_headed(self, type_name: str) -> bool:
        _, fields = self._store.fielddefs.get(type_name, ([], []))
        return bool(fields) and fields[0][1] == (Nodetype.NAME, _HEADER)

    def _why(self, type_name: str, size: int) -> str:
        if not self.knows(type_name):
            return f"{type_name}: unknown type, not defined in the recording"
        return f"cannot decode {size} bytes as {type_name}"


def _make_store(encoding: Encoding) -> BoundedStore:
    store = BoundedStore(get_typestore(_STORES[encoding]))
    added = {}
    for name, text in _ADDED_TYPES[encoding].items():
        added.update(get_types_from_msg(text, name))
    store.register(added)
    return store


class Undecoded(Definitions):
    """One type of a recording that cannot be decoded: its messages can only be copied with it.

    Args:
        text, digest: its definition and hash in the recording.
        why: the reason.
    """

    def __init__(self, encoding: Encoding, text: str, digest: str, why: str) -> None:
        super().__init__(encoding)
        self._text, self._digest, self._reason = text, digest, why

    def knows(self, type_name: str) -> bool:
        return False

    def read(self, type_name: str, data: bytes | memoryview) -> Any:
        raise DamagedMessage(self._reason)

    def text(self, type_name: str) -> str:
        return self._text

    def digest(self, type_name: str) -> str:
        return self._digest

    def starts_with_header(self, type_name: str) -> bool:
        return False

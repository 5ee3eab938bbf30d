"""The message types of one recording: how its bytes are read and written."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterable, Mapping
from typing import Any, Literal

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from ros_visualise.core.errors import DamagedMessage, TooLarge
from ros_visualise.messages.added_types import ADDED_TYPES
from ros_visualise.messages.bounded import BoundedStore
from ros_visualise.messages.expansion import check_expansion

Encoding = Literal["ros1", "cdr"]
"""How messages stand as bytes: as ROS 1 sends them, or as ROS 2 does (plain CDR)."""

_STORES = {"ros1": Stores.ROS1_NOETIC, "cdr": Stores.ROS2_JAZZY}
_HEADER = "std_msgs/msg/Header"


_LONGEST = 256 << 10  # the library parses 100 KiB in a second; the longest real ones have that
_COMMENT = re.compile(r"\s*#")
_BOUND = re.compile(r"^(\s*string)<=\d+(?=\s+[A-Z]\w*\s*=)", re.MULTILINE)
_EMPTY = re.compile(r"^(\s*string\s+[A-Z]\w*\s*=)[ \t]*$", re.MULTILINE)


def parse(text: str, type_name: str) -> dict[str, Any]:
    """The types of a definition, as a typestore's ``fielddefs`` has them.

    Raises:
        Exception: the text is no definition; the library's parser raises what it happens to meet.
    """
    # the library takes long for comments, and knows neither bounds nor emptiness of constants
    lines = [line for line in text.split("\n") if line.strip() and not _COMMENT.match(line)]
    text = _EMPTY.sub(r'\1 ""', _BOUND.sub(r"\1", "\n".join(lines) + "\n"))
    check_length(text)
    return dict(get_types_from_msg(text, type_name))


def check_length(text: str) -> None:
    """Look at a definition before it is parsed.

    Raises:
        TooLarge: that would take long.
    """
    if len(text) > _LONGEST:
        raise TooLarge(f"its definition is longer than {_LONGEST >> 10} KiB")


def parts_of(fields: Iterable[tuple[str, Any]]) -> set[str]:
    """The types that fields are of, as a typestore's ``fielddefs`` has the fields."""
    flat = (d[1][0] if d[0] in (Nodetype.ARRAY, Nodetype.SEQUENCE) else d for _, d in fields)
    return {name for kind, name in flat if kind == Nodetype.NAME}


class Definitions:
    """The types of ROS 1 or ROS 2 and those that a recording defines itself.

    Types are written ``package/msg/Name``. All of it may be called from any thread.
    """

    def __init__(self, encoding: Encoding) -> None:
        self.encoding: Encoding = encoding
        self._given: dict[str, str] = {}
        self._starts_with_header: dict[str, bool] = {}
        self._lock = threading.RLock()
        self._made: BoundedStore | None = None

    @property
    def _store(self) -> BoundedStore:
        """Made when it is needed, which takes a fifth of a second."""
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
        """What the library that reads and writes messages knows of the types."""
        return self._store

    def define(self, type_name: str, text: str) -> None:
        """Add a type from its definition, with those that it is made of; they win over ROS's own.

        Raises:
            DamagedMessage: the text is no definition.
        """
        with self._lock:
            if self._given.get(type_name) == text:
                return
            try:
                found = parse(text, type_name)
                check_expansion(type_name, {**self._store.fielddefs, **found})
                changed = {n: t for n, t in found.items() if self._store.fielddefs.get(n) != t}
                for name in changed:
                    self._store.fielddefs.pop(name, None)
                self._store.register(changed)
                self._store.forget()  # readers of the types as they were before
            except TooLarge as error:
                raise DamagedMessage(f"{type_name}: {error}") from error
            except Exception as error:  # the library's parser raises what it happens to meet
                raise DamagedMessage(f"{type_name}: its definition cannot be read") from error
            self._given[type_name] = text
            self._starts_with_header.clear()

    def knows(self, type_name: str) -> bool:
        """Whether messages of that type can be read."""
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
        except Exception as error:  # the library's readers raise what they happen to meet
            raise DamagedMessage(self._why(type_name, len(data))) from error

    def write(self, type_name: str, message: Any) -> memoryview:
        """The bytes of a message of one of `types`."""
        store = self._store
        write = store.serialize_ros1 if self.encoding == "ros1" else store.serialize_cdr
        return write(message, type_name)

    def text(self, type_name: str) -> str:
        """A type's whole definition: as it was given, else as ROS has it."""
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
        """Whether messages of that type begin with a std_msgs/Header."""
        if type_name not in self._starts_with_header:
            self._starts_with_header[type_name] = self._looks_headed(type_name)
        return self._starts_with_header[type_name]

    @property
    def _version(self) -> Literal[1, 2]:
        return 1 if self.encoding == "ros1" else 2

    def _looks_headed(self, type_name: str) -> bool:
        _, fields = self._store.fielddefs.get(type_name, ([], []))
        return bool(fields) and fields[0][1] == (Nodetype.NAME, _HEADER)

    def _why(self, type_name: str, size: int) -> str:
        if not self.knows(type_name):
            return f"{type_name}: an unknown type, and the recording does not define it"
        return f"{size} bytes are no {type_name}"


def _make_store(encoding: Encoding) -> BoundedStore:
    store = BoundedStore(get_typestore(_STORES[encoding]))
    added = {}
    for name, text in ADDED_TYPES[encoding].items():
        added.update(get_types_from_msg(text, name))
    store.register(added)
    return store


class Undecoded(Definitions):
    """What a recording says of one type that cannot be read: its messages can be copied with it.

    Args:
        text, digest: as the recording has them.
        why: it cannot be read.
    """

    def __init__(self, encoding: Encoding, text: str, digest: str, why: str) -> None:
        super().__init__(encoding)
        self._text, self._digest, self._reason = text, digest, why

    def knows(self, type_name: str) -> bool:
        """As `Definitions.knows`: no."""
        return False

    def read(self, type_name: str, data: bytes | memoryview) -> Any:
        """As `Definitions.read`."""
        raise DamagedMessage(self._reason)

    def text(self, type_name: str) -> str:
        """As it was given."""
        return self._text

    def digest(self, type_name: str) -> str:
        """As it was given."""
        return self._digest

    def starts_with_header(self, type_name: str) -> bool:
        """As `Definitions.starts_with_header`: nobody knows."""
        return False

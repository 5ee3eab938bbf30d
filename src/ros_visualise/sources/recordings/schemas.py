"""The message types that a recording defines, sorted into `Definitions` that do not conflict."""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from typing import Any

from rosbags.typesys import (
    Stores,
    TypesysError,
    get_types_from_idl,
    get_typestore,
)

from ros_visualise.core.errors import DamagedMessage, TooLarge
from ros_visualise.messages.definitions import (
    Definitions,
    Encoding,
    Undecoded,
    check_length,
    parse,
    parts_of,
)
from ros_visualise.sources.recordings.storage import Channel

_TRANSIENT_LOCAL = re.compile(r"durability['\"]?\s*:\s*['\"]?(1|transient_local)\b", re.IGNORECASE)

_NOT_IDL = re.compile(r"^(=+|IDL: .*|#.*)$", re.MULTILINE)

_Types = dict[str, Any]


class Schemas:
    """Makes one `Definitions` per encoding, and another where two definitions of a name differ.

    Args:
        most_text: most letters of all definitions together.
    """

    def __init__(self, most_text: int = sys.maxsize) -> None:
        self._text_left = most_text
        self._spaces: dict[Encoding, list[tuple[Definitions, _Types]]] = {}
        self._found: dict[tuple[Encoding, str, str, bool], Definitions] = {}
        self._undecoded: dict[tuple[Encoding, str, str], Undecoded] = {}

    def define(
        self, encoding: Encoding, type_name: str, text: str, is_idl: bool = False
    ) -> Definitions:
        """The definitions with a type as its text has it; without a text, as ROS has it.

        Args:
            type_name: ``package/msg/Name``.
            text: with the types that it is made of, as MCAP and rosbag2 hold it.
            is_idl: the text is OMG IDL, else ROS's own language.

        Raises:
            DamagedMessage: the text is no definition, or is missing and not known to ROS.
        """
        key = (encoding, type_name, text, is_idl)
        if key not in self._found:
            self._found[key] = self._define(*key)
        return self._found[key]

    def complete(
        self, channel: Channel, encoding: Encoding, text: str, given: str, is_idl: bool
    ) -> Channel:
        """A channel with the definitions of its type, or why it cannot be read.

        ``given``: digest of the type in the recording, if any.
        """
        name = channel.type_name
        try:
            definitions = self.define(encoding, name, text, is_idl)
        except DamagedMessage as damage:
            why = str(damage)
            if is_idl:
                return replace(channel, unreadable=why)
            undecoded = Undecoded(encoding, text, given, why)
            kept = self._undecoded.setdefault((encoding, name, text), undecoded)
            return replace(channel, definitions=kept, digest=given, unreadable=why)
        return replace(channel, definitions=definitions, digest=given or _digest(definitions, name))

    def _define(self, encoding: Encoding, type_name: str, text: str, is_idl: bool) -> Definitions:
        self._text_left -= len(text)
        if self._text_left < 0:
            raise DamagedMessage(f"{type_name}: skipped; the recording has too many definitions")
        spaces = self._spaces.setdefault(encoding, [(Definitions(encoding), {})])
        if not text.strip() and spaces[0][0].knows(type_name):
            text = spaces[0][0].text(type_name)
        elif not text.strip():
            raise DamagedMessage(f"{type_name}: unknown type, not defined in the recording")
        elif is_idl:
            text = _idl_to_msg(type_name, text)
        types = _parse(type_name, text)
        fitting = (
            space
            for space in spaces
            if all(space[1].get(name, given) == given for name, given in types.items())
        )
        space = next(fitting, None)
        if space is None:
            space = (Definitions(encoding), {})
            spaces.append(space)
        definitions, known = space
        definitions.define(type_name, text)
        known.update(types)
        fields = (field for _, fields in types.values() for field in fields)
        unknown = [name for name in sorted(parts_of(fields)) if not definitions.knows(name)]
        if any(name.endswith("/wstring") for name in unknown):
            raise DamagedMessage(f"{type_name}: wide strings (wstring) are not supported")
        if unknown:
            raise DamagedMessage(f"{type_name}: has a field of the unknown type {unknown[0]}")
        return definitions


def _digest(definitions: Definitions, type_name: str) -> str:
    """MD5 or RIHS01 of a type; empty for types without one, such as those with wide strings."""
    try:
        return definitions.digest(type_name)
    except (KeyError, AssertionError, TypesysError):
        return ""


def ros_name(name: str) -> str:
    """A type's name as ``package/msg/Name``, from ``package/Name`` too."""
    parts = name.split("/")
    return f"{parts[0]}/msg/{parts[1]}" if len(parts) == 2 else name


def is_latched(offered_qos_profiles: str) -> bool:
    """True if rosbag2's note of its publishers' QoS, in numbers or words, has a latched one."""
    return bool(_TRANSIENT_LOCAL.search(offered_qos_profiles))


def _parse(type_name: str, text: str) -> _Types:
    try:
        return parse(text, type_name)
    except TooLarge as error:
        raise DamagedMessage(f"{type_name}: {error}") from error
    except Exception as error:  # the library's parser raises what it happens to meet
        raise DamagedMessage(f"{type_name}: its definition cannot be read") from error


def _idl_to_msg(type_name: str, text: str) -> str:
    """The same definition in ROS's own language."""
    store = get_typestore(Stores.ROS2_JAZZY)
    try:
        check_length(text)
        types = get_types_from_idl(_NOT_IDL.sub("", text))
        for name in types:
            store.fielddefs.pop(name, None)
        store.register(types)
        return store.generate_msgdef(type_name, ros_version=2)[0]
    except TooLarge as error:
        raise DamagedMessage(f"{type_name}: {error}") from error
    except Exception as error:  # the library's parser raises what it happens to meet
        raise DamagedMessage(f"{type_name}: its IDL definition cannot be read") from error

"""The kinds of messages that a browser may send, and their forms."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from viser._messages import KeyModifier

MAX_BYTES = 64 * 1024
"""Of one message; what a person types is the largest."""

Value = bool | int | float | str
_Length = Annotated[float, msgspec.Meta(ge=-1e9, le=1e9)]
_Size = Annotated[float, msgspec.Meta(ge=0, le=65536)]
_Name = Annotated[str, msgspec.Meta(max_length=64)]


class _Message(msgspec.Struct, tag_field="type", forbid_unknown_fields=True):
    """A message of viser's protocol, by its name there."""


class Camera(_Message, tag="ViewerCameraMessage"):
    """The viewpoint has changed."""

    wxyz: tuple[_Length, _Length, _Length, _Length]
    position: tuple[_Length, _Length, _Length]
    fov: _Size
    near: _Length
    far: _Length
    image_height: _Size
    image_width: _Size
    look_at: tuple[_Length, _Length, _Length]
    up_direction: tuple[_Length, _Length, _Length]


class Click(_Message, tag="ScenePointerMessage"):
    """Somebody clicked into the scene."""

    event_type: Literal["click"]
    ray_origin: tuple[_Length, _Length, _Length]
    ray_direction: tuple[_Length, _Length, _Length]
    screen_pos: Annotated[list[tuple[_Length, _Length]], msgspec.Meta(max_length=2)]
    modifier: KeyModifier | None


class Command(_Message, tag="CommandTriggerMessage"):
    """A key was pressed, or a command was chosen."""

    uuid: _Name


class _Updates(msgspec.Struct, forbid_unknown_fields=True):
    value: Value


class Update(_Message, tag="GuiUpdateMessage"):
    """An element was moved."""

    uuid: _Name
    updates: _Updates


_DECODER = msgspec.msgpack.Decoder(Camera | Click | Command | Update)


def understand(data: str | bytes) -> Camera | Click | Command | Update | None:
    """The message in these bytes; None if our page sends no such message."""
    try:
        return _DECODER.decode(data) if isinstance(data, bytes) else None
    except (msgspec.MsgspecError, RecursionError):
        return None

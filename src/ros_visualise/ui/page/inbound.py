"""The messages that a browser may send, and the values that elements may have."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any, Literal

import msgspec
import viser
from viser._messages import KeyModifier

Value = bool | int | float | str
_Length = Annotated[float, msgspec.Meta(ge=-1e9, le=1e9)]
_Size = Annotated[float, msgspec.Meta(ge=0, le=65536)]
_Name = Annotated[str, msgspec.Meta(max_length=64)]


class _Message(msgspec.Struct, tag_field="type", forbid_unknown_fields=True):
    """A message of viser's protocol, by its name there."""


class CameraMessage(_Message, tag="ViewerCameraMessage"):
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


class ClickMessage(_Message, tag="ScenePointerMessage"):
    """A click into the scene."""

    event_type: Literal["click"]
    ray_origin: tuple[_Length, _Length, _Length]
    ray_direction: tuple[_Length, _Length, _Length]
    screen_pos: Annotated[list[tuple[_Length, _Length]], msgspec.Meta(max_length=2)]
    modifier: KeyModifier | None


class CommandMessage(_Message, tag="CommandTriggerMessage"):
    """A key was pressed, or a command was chosen."""

    uuid: _Name


class _Updates(msgspec.Struct, forbid_unknown_fields=True):
    value: Value


class UpdateMessage(_Message, tag="GuiUpdateMessage"):
    """An element was moved."""

    uuid: _Name
    updates: _Updates


Inbound = CameraMessage | ClickMessage | CommandMessage | UpdateMessage
_DECODER = msgspec.msgpack.Decoder(Inbound)


def understand(
    data: str | bytes,
) -> Inbound | None:
    """The message in these bytes; None for any that our page does not send."""
    try:
        return _DECODER.decode(data) if isinstance(data, bytes) else None
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None


MAX_WHOLE = 2**53
"""JavaScript is exact up to here."""
MAX_TEXT = 4096


def refusal(element: object, value: Value) -> str:
    """The reason why an element cannot have a value; empty if it can."""
    for kind, check in _CHECKS.items():
        if isinstance(element, kind):
            return check(element, value)
    return "cannot be set"


def _check_number(element: Any, value: Value) -> str:
    if isinstance(value, bool | str) or not math.isfinite(value):
        return f"{_shown(value)} is not a number"
    is_whole = isinstance(element.value, int)
    if is_whole and value != int(value):
        return f"{value:g} is not a whole number"
    low, high = element.min, element.max
    low = -MAX_WHOLE if low is None else low
    high = MAX_WHOLE if high is None else high
    close = 1e-9 * max(abs(low), abs(high))  # as near as browsers come to a slider's end
    if low - close <= value <= high + close:
        return ""
    return f"{value:g} is outside of {low:g} to {high:g}"


def _check_switch(_: Any, value: Value) -> str:
    return "" if isinstance(value, bool) else f"{_shown(value)} is neither on nor off"


def _check_text(_: Any, value: Value) -> str:
    if not isinstance(value, str):
        return f"{_shown(value)} is not a text"
    return "" if len(value) <= MAX_TEXT else f"longer than {MAX_TEXT} characters"


def _check_choice(element: Any, value: Value) -> str:
    return "" if value in element.options else f"{_shown(value)} is not one of the choices"


_CHECKS: dict[type, Callable[[Any, Value], str]] = {
    viser.GuiSliderHandle: _check_number,
    viser.GuiNumberHandle: _check_number,
    viser.GuiCheckboxHandle: _check_switch,
    viser.GuiTextHandle: _check_text,
    viser.GuiDropdownHandle: _check_choice,
    viser.GuiButtonGroupHandle: _check_choice,
    viser.GuiButtonHandle: _check_switch,
}


def _shown(value: Value) -> str:
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:40]}..."

"""The values that browsers may set elements of the page to."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import viser

from ros_visualise.ui.page.inbound import Value

MAX_WHOLE = 2**53
"""Up to here JavaScript tells whole numbers apart."""
MAX_TEXT = 4096
_LIMITS = "limits_of_browsers"  # an attribute that elements of viser do not have


def widen(element: viser.GuiInputHandle[Any], low: float | None, high: float | None) -> None:
    """Let browsers type values beyond a slider's ends, up to these limits; None: without limit."""
    setattr(element, _LIMITS, (low, high))


def refusal(element: object, value: Value) -> str:
    """Why an element cannot have a value, in words; empty if it can."""
    for kind, check in _CHECKS.items():
        if isinstance(element, kind):
            return check(element, value)
    return "it cannot be set"


def _check_number(element: Any, value: Value) -> str:
    if isinstance(value, bool | str) or not math.isfinite(value):
        return f"{_shown(value)} is not a number"
    is_whole = isinstance(element.value, int)
    if is_whole and value != int(value):
        return f"{value:g} is not a whole number"
    low, high = getattr(element, _LIMITS, None) or (element.min, element.max)
    low = -MAX_WHOLE if low is None else low
    high = MAX_WHOLE if high is None else high
    close = 1e-9 * max(abs(low), abs(high))  # as near as browsers come to a slider's end
    if low - close <= value <= high + close:
        return ""
    return f"{value:g} is not from {low:g} to {high:g}"


def _check_switch(_: Any, value: Value) -> str:
    return "" if isinstance(value, bool) else f"{_shown(value)} is not on or off"


def _check_text(_: Any, value: Value) -> str:
    if not isinstance(value, str):
        return f"{_shown(value)} is not a text"
    return "" if len(value) <= MAX_TEXT else f"it may have at most {MAX_TEXT} characters"


def _check_choice(element: Any, value: Value) -> str:
    return "" if value in element.options else f"{_shown(value)} is not among the choices"


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

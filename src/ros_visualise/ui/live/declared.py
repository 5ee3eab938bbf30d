"""Parameters and actions as browsers show them: labels, kinds and limits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import Enum
from typing import Any

from ros_visualise.core.params import Spec, Value
from ros_visualise.graph import Member
from ros_visualise.ui.trackbars import step_of

_ABBREVIATIONS = {
    word.lower(): word
    for word in ("CLAHE", "FPS", "GPS", "HSV", "IMU", "L2", "ROI", "TF", "URI", "URL", "Wi-Fi")
}
_STEPS = 200
"""Approximate number of steps of a slider for floats."""


def sentence(name: str) -> str:
    """The label for a name such as ``max_poses``: Max poses."""
    words = [_ABBREVIATIONS.get(word, word) for word in name.replace("_", " ").split(" ")]
    text = " ".join(words)
    return text if len(text) == 1 else text[:1].upper() + text[1:]


def label_of(spec: Spec) -> str:
    """The label of a parameter."""
    return sentence(spec.label or spec.name)


def sent(value: Value) -> Any:
    """A parameter's value as it is sent; of an Enum and of an infinity its text."""
    if isinstance(value, Enum):
        return str(value.value)
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def declaration(spec: Spec) -> Mapping[str, Any]:
    """A parameter as browsers show it."""
    kind = "choice" if spec.choices else spec.type.__name__
    declared: dict[str, Any] = {"name": spec.name, "label": label_of(spec), "kind": kind}
    declared |= {"help": spec.help, "group": sentence(spec.group) if spec.group else ""}
    if spec.choices:
        declared["choices"] = spec.choices
    if spec.type in (int, float):
        limits = {"min": spec.min, "max": spec.max, "step": spec.step}
        declared |= {n: x for n, x in limits.items() if x is not None and math.isfinite(x)}
    if spec.type in (int, float) and spec.range is not None:
        low, high = spec.range
        declared |= {"low": low, "high": high, "step": step_of(spec, low, high, _STEPS)}
    return declared


def actions_of(node: Member) -> list[Mapping[str, str]]:
    """The actions of a node, as browsers show them."""
    return [
        {"name": name, "label": sentence(name), "help": help}
        for name, help in node.type.actions.items()
    ]

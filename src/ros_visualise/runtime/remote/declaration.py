"""Declarations of a remote node's parameters, which are known only at run time."""

from __future__ import annotations

import keyword
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, make_dataclass
from enum import Enum
from typing import Any

from ros_visualise.core.params import param


@dataclass(frozen=True)
class ParameterDescription:
    """One parameter of a remote node, as the node describes it.

    Attributes:
        name: on the node.
        type: bool, int, float or str.
        default: of that type.
        help: its purpose.
        min: lowest value; None: no limit.
        max: highest value; None: no limit.
        group: its folder on the page.
        choices: text of a choice -> the value to send; empty: any value.
        step: from one value to the next; None: any value.
        label: its name on the node, if ``name`` is another one.
        read_only: it cannot be set.
    """

    name: str
    type: type
    default: Any
    help: str = ""
    min: float | None = None
    max: float | None = None
    group: str = ""
    choices: Mapping[str, Any] = field(default_factory=dict)
    step: float | None = None
    label: str = ""
    read_only: bool = False

    @property
    def is_choice(self) -> bool:
        """True if its value is one of its choices, as of an Enum."""
        return self.default in self.choices.values()


def declared(parameters: Iterable[ParameterDescription]) -> type:
    """A dataclass of `ros_visualise.core.params.param` fields; a choice is an Enum of its texts."""
    return make_dataclass("Params", [_field(one) for one in parameters], frozen=True)


def name_here(name: str) -> str:
    """A parameter's name as a valid name of a field."""
    return f"{name}_" if _is_reserved(name) else name


def name_there(name: str) -> str:
    """A field's name as its node knows it."""
    return name[:-1] if _is_reserved(name[:-1]) else name


def _is_reserved(name: str) -> bool:
    """True for a word of Python, or a name such as ``__class__`` that means something to it."""
    return keyword.iskeyword(name) or (name.startswith("__") and name.endswith("__"))


def _field(described: ParameterDescription) -> tuple[str, type, Any]:
    name = name_here(described.name)
    kind, value = _choice(described) if described.is_choice else (described.type, described.default)
    is_same = name == described.name and not (described.choices or described.label)
    made = param(
        value,
        described.help,
        min=described.min,
        max=described.max,
        group=described.group,
        saved=is_same and not described.read_only,  # otherwise its name or value differs here
        used=lambda _: not described.read_only,
        step=described.step,
        label=described.label,
    )
    return name, kind, made


def _choice(described: ParameterDescription) -> tuple[type, Any]:
    """An Enum of the texts of its choices, and the member for its default."""
    members = [(f"CHOICE_{number}", text) for number, text in enumerate(described.choices)]
    made: Any = Enum(described.name, members)  # type: ignore[misc]  # known only now
    return made, made(
        next(text for text, one in described.choices.items() if one == described.default)
    )

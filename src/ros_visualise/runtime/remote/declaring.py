"""A declaration made for the parameters of a node elsewhere, which are known only at run time."""

from __future__ import annotations

import keyword
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, make_dataclass
from enum import Enum
from typing import Any

from ros_visualise.core.params import param


@dataclass(frozen=True)
class Told:
    """What a node tells of one of its parameters.

    Attributes:
        name: as it is there.
        type: bool, int, float or str.
        default: of that type.
        help: what it is for.
        min: the lowest value; None where there is none.
        max: the highest value.
        group: under which it is shown.
        choices: text of a choice -> the value that is sent for it; empty where any value will do.
        step: from one value to the next; None: any value will do.
        label: its name there, where ``name`` is another one.
        read_only: it can be looked at alone.
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
        """Whether one of its choices is to be taken, as of an Enum."""
        return self.default in self.choices.values()


def declared(told: Iterable[Told]) -> type:
    """A dataclass of `ros_visualise.core.params.param` fields; a choice is an Enum of its texts."""
    return make_dataclass("Params", [_field(one) for one in told], frozen=True)


def name_here(name: str) -> str:
    """The name of a parameter as a field may have it."""
    return f"{name}_" if keyword.iskeyword(name) else name


def name_there(name: str) -> str:
    """The name of a field as its node has it."""
    return name[:-1] if keyword.iskeyword(name[:-1]) else name


def _field(told: Told) -> tuple[str, type, Any]:
    name = name_here(told.name)
    kind, value = _choice(told) if told.is_choice else (told.type, told.default)
    is_same = name == told.name and not (told.choices or told.label)
    made = param(
        value,
        told.help,
        min=told.min,
        max=told.max,
        group=told.group,
        saved=is_same and not told.read_only,  # else it is called or written otherwise here
        used=lambda _: not told.read_only,
        step=told.step,
        label=told.label,
    )
    return name, kind, made


def _choice(told: Told) -> tuple[type, Any]:
    """An Enum of the texts of its choices, and the member for its default."""
    members = [(f"CHOICE_{number}", text) for number, text in enumerate(told.choices)]
    made: Any = Enum(told.name, members)  # type: ignore[misc]  # known only now
    return made, made(next(text for text, one in told.choices.items() if one == told.default))

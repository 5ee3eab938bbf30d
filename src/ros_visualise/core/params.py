"""A node's parameters, declared once as a frozen dataclass.

    @dataclass(frozen=True)
    class EdgeParams:
        low: int = param(200, "hysteresis low threshold", min=0, max=800)

Sliders, command-line options, YAML keys, ROS parameters and help all follow from `specs`.
"""

from __future__ import annotations

import dataclasses
import os
import threading
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, Generic, TypeVar

from ros_visualise.core.errors import ParameterError, UsageError, did_you_mean
from ros_visualise.core.paths import given_folder, inside

Plain = bool | int | float | str
Value = Plain | Enum
P = TypeVar("P")


def param(
    default: Any,
    help: str,
    *,
    min: float | None = None,
    max: float | None = None,
    slider: tuple[float, float] | None = None,
    restart: bool = False,
    group: str = "",
    saved: bool = True,
    used: Callable[[Any], bool] = lambda params: True,
    file: Callable[[Any], bool] = lambda value: False,
    step: float | None = None,
    label: str = "",
    preset: Callable[[Any], Mapping[str, Any]] = lambda value: {},
) -> Any:
    """Declare one parameter of type int, float, bool, str or Enum.

    Args:
        default: initial value.
        help: one line: a noun phrase, with the unit and the meaning of special values.
        min, max: limits of a number, inclusive.
        slider: range of the slider, if narrower than the limits.
        restart: True if a change reopens the source.
        group: folder on the page; empty: always visible.
        saved: False for what is played and how, which *Save parameters* skips.
        used: returns False if the parameter has no effect with the given values of all parameters,
            so that its slider is disabled; see `when` and `unless`.
        file: returns True if a value names a file. While the node runs, it may only be set to a
            file in the folder of `ros_visualise.core.paths`, or back to an earlier value.
        step: distance between values; None: any value.
        label: displayed name, if it is not a valid Python identifier.
        preset: returns the values of other parameters that come with a value of this one. Those of
            unknown names are skipped, and those that change with it keep their own values.
    """
    metadata: dict[str, Any] = {"help": help, "min": min, "max": max, "slider": slider}
    metadata |= {"restart": restart, "group": group, "saved": saved, "used": used, "file": file}
    metadata |= {"step": step, "label": label, "preset": preset}
    return dataclasses.field(default=default, metadata=metadata)


def when(name: str, *values: Value) -> Callable[[Any], bool]:
    """A condition for ``used``: another parameter has one of these values."""
    return lambda params: getattr(params, name) in values


def unless(name: str, *values: Value) -> Callable[[Any], bool]:
    """A condition for ``used``: another parameter has a value other than these."""
    return lambda params: getattr(params, name) not in values


def plain_of(value: Value) -> Plain:
    """A value as files and other programs have it: of an Enum its text."""
    return str(value.value) if isinstance(value, Enum) else value


@dataclass(frozen=True)
class Spec:
    """One declared parameter."""

    name: str
    type: type
    default: Value
    help: str
    min: float | None
    max: float | None
    slider: tuple[float, float] | None
    restart: bool
    group: str
    saved: bool
    used: Callable[[Any], bool]
    file: Callable[[Any], bool]
    step: float | None
    label: str
    preset: Callable[[Any], Mapping[str, Any]]

    @property
    def choices(self) -> tuple[str, ...]:
        """Values of an Enum, as text; empty for other types."""
        return tuple(str(c.value) for c in self.type) if issubclass(self.type, Enum) else ()

    @property
    def range(self) -> tuple[float, float] | None:
        """The slider's range: ``slider`` where declared, else the hard limits."""
        if self.slider is not None:
            return self.slider
        return None if self.min is None or self.max is None else (self.min, self.max)

    def coerce(self, value: Any) -> Value:
        """Convert a value or its text to this parameter's type.

        Raises:
            ParameterError: wrong type or out of range; the message names the allowed values.
        """
        if value is None:
            raise ParameterError(f"{self.name}: needs a value")
        if issubclass(self.type, Enum):
            return self._choose(value)
        if self.type is bool:
            return self._switch(value)
        if self.type is str:
            return str(value)
        return self._number(value)

    def clamp(self, number: float) -> float:
        """The number, limited to the range from ``min`` to ``max``."""
        low = number if self.min is None else max(number, self.min)
        return low if self.max is None else min(low, self.max)

    def _choose(self, value: Any) -> Enum:
        text = str(plain_of(value))
        for choice in self.type:  # type: ignore[attr-defined]
            if text == str(choice.value):
                return typing.cast(Enum, choice)
        raise ParameterError(f"{self.name}={text}: choose one of {', '.join(self.choices)}")

    def _switch(self, value: Any) -> bool:
        words = {"true": True, "1": True, "on": True, "yes": True}
        words |= {"false": False, "0": False, "off": False, "no": False}
        text = str(value).lower()
        if text not in words:
            raise ParameterError(f"{self.name}={value}: choose true or false")
        return words[text]

    def _number(self, value: Any) -> int | float:
        try:
            if isinstance(value, bool):
                raise ValueError
            number = float(value)
            if self.type is int and number != int(number):
                raise ValueError
        except (TypeError, ValueError, OverflowError):
            kind = "a whole number" if self.type is int else "a number"
            raise ParameterError(f"{self.name}={value}: must be {kind}{self._limits()}") from None
        low = float("-inf") if self.min is None else self.min
        high = float("inf") if self.max is None else self.max
        if not low <= number <= high:
            raise ParameterError(f"{self.name}={value}: must be{self._limits()}")
        return int(number) if self.type is int else number

    def _limits(self) -> str:
        if self.min is not None and self.max is not None:
            return f" from {self.min:g} to {self.max:g}"
        if self.min is not None:
            return f" at least {self.min:g}"
        return "" if self.max is None else f" at most {self.max:g}"


def specs(params: Any) -> tuple[Spec, ...]:
    """The declared parameters of a params class or its instance, in order."""
    cls = params if isinstance(params, type) else type(params)
    types = typing.get_type_hints(cls)
    fields = dataclasses.fields(cls)
    return tuple(Spec(f.name, types[f.name], f.default, **f.metadata) for f in fields)


def update(params: P, changes: Mapping[str, Any]) -> P:
    """A copy of ``params`` with all changes applied.

    Raises:
        ParameterError: an unknown name (the known ones are listed) or an invalid value.
    """
    known = {spec.name: spec for spec in specs(params)}
    for name in changes:
        if name not in known:
            raise ParameterError(f"no parameter {name!r}{did_you_mean(name, known)}")
    values = {name: known[name].coerce(value) for name, value in changes.items()}
    for name in changes:
        further = known[name].preset(values[name])
        values = {n: known[n].coerce(v) for n, v in further.items() if n in known} | values
    return dataclasses.replace(params, **values)  # type: ignore[type-var]


class Parameters(Generic[P]):
    """A node's live parameters: an immutable object, replaced as a whole.

    ``current`` may be read from any thread without a lock. ``accept`` is called before each change,
    and raises ParameterError to reject it.
    """

    def __init__(self, initial: P) -> None:
        self.current = _settled(initial)
        self.accept: Callable[[P, Mapping[str, Value]], None] = lambda *_: None
        self._files = _files_of(self.current)
        self._lock = threading.RLock()
        self._listeners: list[Callable[[P, Mapping[str, Value]], None]] = []

    def update(self, changes: Mapping[str, Any]) -> P:
        """Apply all changes or none, as requested by a page or a graph.

        Like `take`, but new file names are confined to one folder; see ``file`` of `param`.

        Raises:
            ParameterError: as `take`, or for a file outside the folder.
        """
        with self._lock:
            return self.take(self._confined(changes))

    def take(self, changes: Mapping[str, Any]) -> P:
        """Apply all changes or none; listeners get the values that differ.

        Raises:
            ParameterError: an unknown name, an invalid value, or ``accept`` rejects the change.
        """
        with self._lock:
            before = self.current
            after = update(before, changes)
            values = {spec.name: getattr(after, spec.name) for spec in specs(after)}
            changed = {n: v for n, v in values.items() if v != getattr(before, n)}
            if changed:
                self.accept(after, changed)
                self.current = after
                self._files |= _files_of(after)
                for listener in tuple(self._listeners):
                    listener(after, changed)
            return self.current

    def on_change(self, listener: Callable[[P, Mapping[str, Value]], None]) -> Callable[[], None]:
        """Call ``listener(current, changed)`` after each change; the result unregisters it."""
        with self._lock:
            self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    def _confined(self, changes: Mapping[str, Any]) -> dict[str, Any]:
        """The changes, with new files in the one folder."""
        values = dict(changes)
        for spec in specs(self.current):
            if spec.name not in values or spec.type is not str:
                continue
            value = str(spec.coerce(values[spec.name]))
            if spec.file(value) and (spec.name, value) not in self._files:
                values[spec.name] = _in_folder(spec.name, value)
        return values


def _settled(params: P) -> P:
    """Parameters whose default files are in the folder of files that may be named."""
    files = {
        spec.name: str(given_folder() / str(spec.default))
        for spec in specs(params)
        if spec.default == getattr(params, spec.name) and spec.file(spec.default)
    }
    return update(params, files)


def _files_of(params: Any) -> set[tuple[str, Any]]:
    """The parameters that name files, with their values."""
    values = [(spec, getattr(params, spec.name)) for spec in specs(params)]
    return {(spec.name, value) for spec, value in values if spec.file(value)}


def _in_folder(name: str, value: str) -> str:
    folder = given_folder()
    try:
        return str(inside(folder, value.removeprefix(f"{folder}{os.sep}")))
    except UsageError as error:
        raise ParameterError(f"{name}: {error}") from None

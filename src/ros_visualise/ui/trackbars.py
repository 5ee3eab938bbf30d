"""OpenCV trackbars for the parameters of a node."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any

import cv2

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import Parameters, Spec, Value, specs

_ROUNDING = 1e-9
_STEPS = 100  # that a float's range is divided into, at least


@dataclass(frozen=True)
class Scale:
    """The scale of a parameter on a trackbar, whose positions are 0, 1, ... ``last``."""

    spec: Spec
    low: float
    step: float
    last: int

    def position(self, value: Value) -> int:
        """The position nearest to a value."""
        if isinstance(value, Enum):
            return self.spec.choices.index(str(value.value))
        assert not isinstance(value, str)
        return min(max(round((value - self.low) / self.step), 0), self.last)

    def value(self, position: int) -> Value:
        """The value at a position."""
        if self.spec.choices:
            return self.spec.coerce(self.spec.choices[position])
        if self.spec.range is None:
            return bool(position)
        return self.spec.coerce(min(round(self.low + position * self.step, 9), self.spec.range[1]))


def scale_of(spec: Spec) -> Scale | None:
    """The scale of a parameter; None for a text, a number without limits, a single choice, and one
    that reopens the source."""
    if spec.restart or spec.type is str:
        return None
    if spec.choices or spec.type is bool:
        low, high, step = 0.0, float(max(len(spec.choices) - 1, spec.type is bool)), 1.0
    elif spec.range is not None:
        low, high = spec.range
        step = float(step_of(spec, low, high, _STEPS))
    else:
        return None
    last = math.ceil((high - low) / step - 1e-9)
    return Scale(spec, low, step, last) if last > 0 else None


def scales_of(params: Any) -> list[Scale]:
    """The scales of all parameters that trackbars can set, in the order of declaration."""
    return [scale for spec in specs(params) if (scale := scale_of(spec)) is not None]


class Trackbars:
    """Some of one node's parameters as trackbars in a window; called from the main thread only."""

    def __init__(self, window: str, parameters: Parameters[Any], scales: list[Scale]) -> None:
        self._window = window
        self._parameters = parameters
        self._shown = parameters.current
        self._moved: dict[Scale, int] = {}
        width = max(len(scale.spec.name) for scale in scales)
        self.names = {scale: scale.spec.name.ljust(width) for scale in scales}
        for scale, name in self.names.items():
            start = scale.position(getattr(self._shown, scale.spec.name))
            cv2.createTrackbar(name, window, start, scale.last, self._listener(scale))
        self._moved.clear()

    def update(self) -> str | None:
        """Apply moved trackbars, and show changes from elsewhere; returns a caption, if any."""
        rejection = self._pass_on()
        if self._parameters.current is self._shown and rejection is None:
            return None
        changed = self._follow()
        return rejection or (_describe(self._shown, changed) if changed else None)

    def _listener(self, scale: Scale) -> Any:
        def moved(position: int) -> None:
            self._moved[scale] = position

        return moved

    def _pass_on(self) -> str | None:
        moved, rejection = dict(self._moved), None
        self._moved.clear()
        for scale, position in moved.items():
            name = scale.spec.name
            if position == scale.position(getattr(self._parameters.current, name)):
                continue
            try:
                self._parameters.update({name: scale.value(position)})
            except ParameterError as error:
                rejection = str(error)
        return rejection

    def _follow(self) -> Spec | None:
        """Set every trackbar to its parameter; returns the last one that changed."""
        before, self._shown = self._shown, self._parameters.current
        changed = None
        for scale, name in self.names.items():
            value = getattr(self._shown, scale.spec.name)
            if value != getattr(before, scale.spec.name):
                changed = scale.spec
            if cv2.getTrackbarPos(name, self._window) != scale.position(value):
                cv2.setTrackbarPos(name, self._window, scale.position(value))
        self._moved.clear()  # the echo of these must not undo changes from elsewhere
        return changed


def _describe(params: Any, spec: Spec) -> str:
    value = getattr(params, spec.name)
    text = value.value if isinstance(value, Enum) else value
    shown = f"{text:.6g}" if isinstance(text, float) else str(text)
    choices = f" ({', '.join(spec.choices)})" if spec.choices else ""
    return f"{spec.name} = {shown}{choices}\n{spec.help}"


def step_of(spec: Spec, low: float, high: float, count: int) -> float:
    """The step of a number's slider: as declared, else 1, or a round one for about so many."""
    if spec.step:
        return spec.step
    return 1 if spec.type is int else round_step((high - low) / count)


def round_step(largest: float) -> float:
    """The largest of ... 0.1, 0.2, 0.5, 1, 2, 5 ... that is not above ``largest``."""
    power = 10.0 ** math.floor(math.log10(largest))
    return next(m * power for m in (5, 2, 1) if m * power <= largest * (1 + _ROUNDING))

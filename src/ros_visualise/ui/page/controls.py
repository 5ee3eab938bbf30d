"""A node's parameters as sliders, switches, choices and fields, and presets of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from enum import Enum
from functools import partial
from typing import Any

import viser

from ros_visualise.core.errors import ParameterError, UsageError
from ros_visualise.core.params import Parameters, Spec, Value
from ros_visualise.graph.presets import NAMES, chosen, preset
from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.saving import live_parameters
from ros_visualise.ui.page.inbound import widen
from ros_visualise.ui.page.worker import Worker
from ros_visualise.ui.trackbars import step_of

_ABBREVIATIONS = {
    word.lower(): word
    for word in ("CLAHE", "FPS", "GPS", "HSV", "IMU", "L2", "ROI", "TF", "URI", "URL", "Wi-Fi")
}
_STEPS = 200
"""Approximate number of steps of a slider for floats."""


class Controls:
    """The elements for one node's parameters.

    A change in a browser sets the parameter. A change elsewhere, or a rejection, sets the element
    in all browsers. Elements without an effect at present are disabled.
    """

    def __init__(
        self, gui: viser.GuiApi, node: str, parameters: Parameters[Any], worker: Worker
    ) -> None:
        self._gui, self._node, self._parameters, self._worker = gui, node, parameters, worker
        self._elements: dict[str, viser.GuiInputHandle[Any]] = {}
        self._used: dict[str, Callable[[Any], bool]] = {}
        self._forget = parameters.on_change(self._changed_elsewhere)

    def add(self, specs: Iterable[Spec]) -> None:
        """Add elements for these parameters to the present container."""
        for spec in specs:
            value = shown(getattr(self._parameters.current, spec.name))
            element = add_element(self._gui, spec, value)
            widen(element, spec.min, spec.max)
            apply = partial(self._apply, spec.name)
            element.on_update(self._worker.listener((self._node, spec.name), apply))
            self._elements[spec.name] = element
            self._used[spec.name] = spec.used
        self._show_use()

    def close(self) -> None:
        """Stop following the parameters; changes that still wait are dropped."""
        self._forget()
        self._elements.clear()

    def _apply(self, name: str, value: Any) -> None:
        if name not in self._elements:
            return
        try:
            self._parameters.update({name: value})
        except ParameterError as error:
            raise ParameterError(f"{self._node}: {error}") from None
        finally:
            self._show(name)

    def _changed_elsewhere(self, _: Any, changed: Mapping[str, Value]) -> None:
        for name in changed.keys() & self._elements.keys():
            self._worker.post(("show", self._node, name), partial(self._show, name))
        self._worker.post(("use", self._node), self._show_use)

    def _show_use(self) -> None:
        """Disable the elements that have no effect beside the present values."""
        for name, element in self._elements.items():
            element.disabled = not self._used[name](self._parameters.current)

    def _show(self, name: str) -> None:
        soon(self._gui, partial(self._show_now, name))

    def _show_now(self, name: str) -> None:
        if self._worker.is_posted((self._node, name)) or name not in self._elements:
            return  # the person at the slider is ahead of us, or it was closed
        value = shown(getattr(self._parameters.current, name))
        element = self._elements[name]
        if isinstance(element, viser.GuiSliderHandle):
            element.min, element.max = min(element.min, value), max(element.max, value)
        set_value(element, value)


def add_element(gui: viser.GuiApi, spec: Spec, value: Any) -> viser.GuiInputHandle[Any]:
    """The element that fits one parameter, in the present container."""
    label = sentence(spec.label or spec.name)
    if spec.choices:
        return gui.add_dropdown(label, spec.choices, initial_value=value, hint=spec.help)
    if spec.type is bool:
        return gui.add_checkbox(label, value, hint=spec.help)
    if spec.type is str:
        return gui.add_text(label, value, hint=spec.help)
    return _add_number(gui, spec, label, value)


def sentence(name: str) -> str:
    """The label for a name such as ``max_poses``: Max poses."""
    words = [_ABBREVIATIONS.get(word, word) for word in name.replace("_", " ").split(" ")]
    text = " ".join(words)
    return text if len(text) == 1 else text[:1].upper() + text[1:]


def shown(value: Value) -> Any:
    """A parameter's value as an element shows it; of an Enum its text."""
    return str(value.value) if isinstance(value, Enum) else value


def soon(gui: viser.GuiApi, action: Callable[[], object]) -> None:
    """Do this on the thread that receives browsers' messages, so that none comes between.

    Otherwise an element could be set in spite of a value that a person has just sent.
    """
    with suppress(RuntimeError):  # the page was closed
        gui._event_loop.call_soon_threadsafe(action)


def set_value(element: viser.GuiInputHandle[Any], value: Any) -> None:
    """Show a value in an element of the page."""
    element.value = value  # type: ignore[misc]  # mypy does not see the setter


def _add_number(gui: viser.GuiApi, spec: Spec, label: str, value: Any) -> viser.GuiInputHandle[Any]:
    number = spec.type
    if spec.range is None:
        low, high = (None if limit is None else number(limit) for limit in (spec.min, spec.max))
        step = None if spec.step is None else number(spec.step)
        return gui.add_number(label, number(value), min=low, max=high, step=step, hint=spec.help)
    low, high = number(min(spec.range[0], value)), number(max(spec.range[1], value))
    step = number(step_of(spec, low, high, _STEPS))
    return gui.add_slider(label, low, high, step, number(value), hint=spec.help)


_OWN = "Custom"


class PresetChoice:
    """A choice of presets that also shows which one the present values are."""

    def __init__(self, gui: viser.GuiApi, runtime: Runtime, worker: Worker) -> None:
        self._runtime = runtime
        hint = "Settings of filters and edge_detector together"
        self._element = gui.add_dropdown("Preset", (*NAMES, _OWN), initial_value=_OWN, hint=hint)
        self._element.on_update(worker.listener("preset", self._set))
        self.refresh()

    def refresh(self) -> None:
        try:
            present = live_parameters(self._runtime).items()
            name = chosen(self._runtime.graph, {node: live.current for node, live in present})
        except UsageError:  # nothing here has presets
            self._element.visible = False
            return
        self._element.visible = True
        set_value(self._element, name or _OWN)

    def _set(self, name: str) -> None:
        if name != _OWN:
            for node, values in preset(name, self._runtime.graph).items():
                self._runtime.parameters[node].update(values)
        self.refresh()

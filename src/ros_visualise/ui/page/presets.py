"""The choice of a preset for the image nodes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import viser

from ros_visualise.core.errors import UsageError
from ros_visualise.graph.presets import NAMES, chosen, preset
from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.saving import live_parameters
from ros_visualise.ui.page.controls import set_value
from ros_visualise.ui.page.worker import Worker

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
        """Show which preset the present values are."""
        try:
            name = chosen(self._runtime.graph, self._current())
        except UsageError:  # nothing here has presets
            self._element.visible = False
            return
        self._element.visible = True
        set_value(self._element, name or _OWN)

    def _current(self) -> Mapping[str, Any]:
        return {node: live.current for node, live in live_parameters(self._runtime).items()}

    def _set(self, name: str) -> None:
        if name != _OWN:
            for node, values in preset(name, self._runtime.graph).items():
                self._runtime.parameters[node].update(values)
        self.refresh()

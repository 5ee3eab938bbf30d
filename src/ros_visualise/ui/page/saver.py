"""The button that saves all parameters."""

from __future__ import annotations

from html import escape
from pathlib import Path

import viser

from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.saving import live_parameters, new_name, save
from ros_visualise.sinks.names import in_folder
from ros_visualise.ui.page.controls import set_value
from ros_visualise.ui.page.worker import Worker


class Saver:
    """A file name, a button, and what was saved last, in the present container.

    As with recordings, files stay in one folder, and nothing there is replaced.
    """

    def __init__(self, gui: viser.GuiApi, runtime: Runtime, worker: Worker, folder: Path) -> None:
        self._runtime, self._folder = runtime, folder
        hint = "a YAML file, for --params and launch files"
        self._name = gui.add_text("parameters", new_name(), hint=hint)
        self._button = gui.add_button("save parameters")
        self._note = gui.add_html("", visible=False)
        self._button.on_click(worker.listener("save", self._save))

    def _save(self, _: bool) -> None:
        path = Path(in_folder(self._folder, self._name.value))
        save(live_parameters(self._runtime), path)
        self._note.content = f'<div class="rv-note">{escape(f"{path}: saved")}</div>'
        self._note.visible = True
        set_value(self._name, new_name())

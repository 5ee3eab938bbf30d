"""The buttons that save all parameters, and how the page is arranged."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

import viser

from ros_visualise.core.paths import inside
from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.saving import live_parameters, new_name, save, write_yaml
from ros_visualise.ui.page.controls import set_value
from ros_visualise.ui.page.kept import Kept
from ros_visualise.ui.page.worker import Worker


class Saver:
    """Names of files, buttons, and what was saved last, in the present container.

    As with recordings, files stay in one folder, and nothing there is replaced.
    """

    def __init__(
        self, gui: viser.GuiApi, runtime: Runtime, worker: Worker, folder: Path, kept: Kept
    ) -> None:
        self._gui, self._worker, self._folder = gui, worker, folder
        parameters = "a YAML file, for --params and launch files"
        self._add("parameters", parameters, lambda path: save(live_parameters(runtime), path))
        layout = "a YAML file, for --layout: what is shown, and how"
        self._add("layout", layout, lambda path: write_yaml(kept.saved, path))
        self._note = gui.add_html("", visible=False)

    def _add(self, what: str, hint: str, write: Callable[[Path], None]) -> None:
        name = self._gui.add_text(what, new_name(what), hint=hint)
        button = self._gui.add_button(f"save {what}")
        button.on_click(self._worker.listener(("save", what), partial(self._save, name, write)))

    def _save(self, name: Any, write: Callable[[Path], None], _: bool) -> None:
        path = inside(self._folder, name.value)
        write(path)
        self._note.content = f'<div class="rv-note">{escape(f"{path}: saved")}</div>'
        self._note.visible = True
        set_value(name, new_name(name.label))

"""The worker, as viser's elements use it."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Hashable
from functools import partial
from typing import Any

import viser

from ros_visualise.ui import worker

Listener = Callable[[viser.GuiEvent[Any]], Coroutine[Any, Any, None]]


class Worker(worker.PageWorker):
    """A worker with callbacks for viser's elements."""

    def listener(self, key: Hashable | None, action: Callable[[Any], object]) -> Listener:
        """A callback for an element: posts a job with the value set; each one for the key None."""

        async def moved(event: viser.GuiEvent[Any]) -> None:
            if event.client_id is not None:  # not by the program
                own = object() if key is None else key
                self.ask(own, partial(action, event.target.value))

        return moved

    def add_key(
        self, gui: viser.GuiApi, label: str, key: Any, action: Callable[[], object]
    ) -> None:
        """Do this whenever a key is pressed, or the command of this name chosen."""

        @gui.add_command(label, hotkey=key).on_trigger
        async def _(_: Any) -> None:
            self.ask(object(), action)

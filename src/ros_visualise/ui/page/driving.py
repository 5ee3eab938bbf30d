"""Driving a robot from the page, by buttons and keys."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import partial
from typing import Any

import numpy as np
import viser

from ros_visualise.data import Twist
from ros_visualise.graph import Graph
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.page.worker import Worker

_STOP = "■"
_Share = tuple[float, float, float, float]
_MOVES: Mapping[str, Mapping[str, tuple[Any, _Share]]] = {
    "linear.x": {"▲ forward": ("i", (1, 0, 0, 0)), "▼ back": ("m", (-1, 0, 0, 0))},
    "angular.z": {"◀ left": ("j", (0, 0, 0, 1)), "▶ right": ("l", (0, 0, 0, -1))},
    "linear.z": {"△ up": ("t", (0, 0, 1, 0)), "▽ down": ("b", (0, 0, -1, 0))},
}
"""Axis of the velocity -> label -> key, and (x, y, z, turn) as shares of the speeds."""


class Driving:
    """Buttons that set a robot's velocity until they stop it; the velocity is sent periodically.

    Args:
        gui: of the page.
        folder: where the elements are.
        runtime: what runs.
        worker: serves these buttons alone, so that a stop never waits.
    """

    def __init__(
        self, gui: viser.GuiApi, folder: viser.GuiFolderHandle, runtime: Runtime, worker: Worker
    ) -> None:
        self._runtime = runtime
        self._topic = velocity_topic(runtime.graph)
        self._share: _Share | None = None
        folder.visible = self._topic is not None
        if self._topic is None:
            return
        axes = _velocity_axes(runtime.graph, self._topic)
        moves = {
            label: move
            for axis, both in _MOVES.items()
            if axis in axes
            for label, move in both.items()
        }
        with folder:
            self._speed = gui.add_slider("speed", 0.1, 3.0, 0.1, 0.8, hint="m/s")
            self._turn = gui.add_slider("turn", 0.1, 2.0, 0.1, 0.6, hint="rad/s")
            labels = (*moves, f"{_STOP} stop")
            keys = ", ".join(key.upper() for key, _ in moves.values())
            buttons = gui.add_button_group("drive", labels, hint=f"keys {keys}; stop: K")
        shares = {label: share for label, (_, share) in moves.items()}
        buttons.on_click(worker.listener("drive", partial(self._press, shares)))
        for label, (key, share) in moves.items():
            name = f"Drive: {label[2:].capitalize()}"
            worker.add_key(gui, name, key, partial(self._go, share))
        worker.add_key(gui, "Drive: Stop", "k", self._stop)

    def refresh(self) -> None:
        """Send the velocity again: without, a robot stops by itself."""
        if self._topic is not None and self._share is not None:
            x, y, z, turn = self._share
            linear = self._speed.value * np.array([x, y, z])
            self._runtime.publish(
                self._topic, Twist(linear, np.array([0, 0, self._turn.value * turn]))
            )

    def rest(self) -> None:
        """Send no more velocities: nobody watches, and the robot stops by itself."""
        self._share = None

    def make_way(self, node: str) -> None:
        """Stop driving if an action of the robot itself was chosen."""
        graph = self._runtime.graph
        if self._topic is not None and self._topic in graph.node(node).inputs.values():
            self._stop()

    def _go(self, share: _Share) -> None:
        self._share = share
        self.refresh()

    def _stop(self) -> None:
        if self._share is not None:
            self._go((0, 0, 0, 0))
            self._share = None

    def _press(self, shares: Mapping[str, _Share], label: str) -> None:
        if label in shares:
            self._go(shares[label])
        else:
            self._stop()


def velocity_topic(graph: Graph) -> str | None:
    """The topic of velocities that a robot of this graph follows, if there is one."""
    return next((topic for topic, kind in graph.inputs.items() if kind is Twist), None)


def _velocity_axes(graph: Graph, topic: str) -> Collection[str]:
    """The axes along which the robot on a topic moves; all of them if that is not declared."""
    source = graph.source
    if source is not None and topic in source.inputs.values():
        return source.type.velocity_axes
    return tuple(_MOVES)

"""What a robot does now, and what it can be asked to do, in one place."""

from __future__ import annotations

from collections.abc import Callable
from html import escape

import viser

from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.feed import Feed
from ros_visualise.ui.page.worker import Worker
from ros_visualise.ui.shown import teller

_FAILED = "failed"


class RobotStatus:
    """A line that says what the robot does, and a button for each of its actions.

    Args:
        gui: of the page.
        folder: where the elements are.
        runtime: what runs.
        worker: does what is asked.
        act: given a node and its action, does it.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        folder: viser.GuiFolderHandle,
        runtime: Runtime,
        worker: Worker,
        act: Callable[[str, str], None],
    ) -> None:
        robot, topic = teller(runtime.graph)
        self._feed = Feed(runtime)
        self._feed.follow(topic)
        if robot is None:
            return
        actions = {name.replace("_", " "): name for name in robot.type.actions}
        with folder:
            self._line = gui.add_html("", visible=False)
            if actions:
                buttons = gui.add_button_group("ask it to", tuple(actions))
                act_on = robot.name
                buttons.on_click(worker.listener(None, lambda label: act(act_on, actions[label])))

    def refresh(self) -> None:
        """Show what it does now."""
        told = self._feed.take()
        if told is not None:
            kind = "rv-status rv-failed" if told.text.startswith(_FAILED) else "rv-status"
            self._line.content = f'<div class="{kind}">{escape(told.text)}</div>'
            self._line.visible = True

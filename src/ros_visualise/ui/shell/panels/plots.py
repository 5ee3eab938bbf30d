"""Numbers of messages over time, against one another and by frequency."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ros_visualise.plotting.colors import PALETTE, css
from ros_visualise.ui.live.derived import FUNCTIONS
from ros_visualise.ui.shell.panels import Panel
from ros_visualise.ui.shown import FIRST_FIELDS


class Plots(Panel, component="plots.js"):
    """Panes of curves below one another, over the same time."""

    title, icon, side, many = "Plot", "show_chart", "bottom", True
    help = "Charts of numbers (signals) over time, XY curves and spectra (FFT)"

    def __init__(self, state: Mapping[str, Any], read_only: bool) -> None:
        super().__init__(state, read_only)
        self._props["colors"] = [css(color) for color in PALETTE]
        self._props["functions"] = list(FUNCTIONS)
        self._props["first"] = FIRST_FIELDS

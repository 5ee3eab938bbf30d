"""Rates and intervals of a topic, and the distribution of a field."""

from __future__ import annotations

from ros_visualise.ui.shell.panels import Panel


class Statistics(Panel, component="statistics.js"):
    """Figures and histograms."""

    title, icon, many = "Statistics", "bar_chart", True
    help = "Rates, frequencies, intervals and histograms"

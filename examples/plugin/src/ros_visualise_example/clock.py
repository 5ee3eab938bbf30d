"""A panel of the page: the time of this browser, large."""

from ros_visualise.ui.shell.panels import Panel


class ClockPanel(Panel, component="clock.js"):
    """A clock, for people who film the screen."""

    title, icon = "Clock", "schedule"

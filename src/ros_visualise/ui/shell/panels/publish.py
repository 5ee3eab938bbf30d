"""Publishing messages from a form."""

from __future__ import annotations

from ros_visualise.ui.shell.panels import Panel


class PublishPanel(Panel, component="publish.js"):
    """A form with the fields of a type, whose message is published once or at a rate."""

    title, icon, side, many = "Publish", "send", "left", True
    help = "Send messages on a topic"

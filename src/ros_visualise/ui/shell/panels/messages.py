"""Messages of a topic: the newest, those before it, and a table of their fields."""

from __future__ import annotations

from ros_visualise.ui.shell.panels import Panel


class Messages(Panel, component="messages.js"):
    """The tree of a message, or a line for each message with some of its fields."""

    title, icon, many = "Messages", "data_object", True
    help = "Messages of a topic as text, as a tree or in a table"

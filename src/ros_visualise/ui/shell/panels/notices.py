"""Warnings and rejections."""

from __future__ import annotations

from ros_visualise.ui.shell.panels import Panel


class NoticeList(Panel, component="notices.js"):
    """A list with the newest first."""

    title, icon = "Notices", "notifications"
    help = "Warnings and rejected input on this page"

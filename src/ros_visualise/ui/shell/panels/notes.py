"""Notes of a recording."""

from __future__ import annotations

from ros_visualise.ui.shell.panels import Panel


class NotesPanel(Panel, component="notes.js"):
    """Text or Markdown that is kept beside the recording."""

    title, icon = "Notes", "edit_note"
    help = "Notes about the recording"

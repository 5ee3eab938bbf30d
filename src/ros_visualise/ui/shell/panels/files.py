"""Files: opened, recorded and saved."""

from __future__ import annotations

from ros_visualise.ui.shell.panels import Panel


class Files(Panel, component="files.js"):
    """Opens and uploads files, records topics, and saves parameters and the layout."""

    title, icon, side = "Files", "folder_open", "left"
    help = (
        "Open, add and upload videos, recordings and other files; open cameras (webcam); record,"
        " export (CSV, video) and download; save the layout"
    )

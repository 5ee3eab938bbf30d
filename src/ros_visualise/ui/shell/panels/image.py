"""Images of topics, with their values."""

from __future__ import annotations

from ros_visualise.ui.shell.panels import Panel


class ImagePanel(Panel, component="image.js"):
    """One image topic, or several side by side, under a wipe, or subtracted."""

    title, icon, side, many = "Image", "image", "middle", True
    help = "Images from cameras and videos: zoom, compare, pixel values"

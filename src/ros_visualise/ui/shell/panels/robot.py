"""A robot's status, its actions, and driving it."""

from __future__ import annotations

from ros_visualise.ui.shell.panels import Panel


class RobotPanel(Panel, component="robot.js"):
    """Buttons that move the robot while they, or their keys, are held."""

    title, icon, side = "Robot", "smart_toy", "left"
    help = "Drive, fly or steer a robot; status and commands"

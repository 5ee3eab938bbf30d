"""A node, a format, a drawing, a panel, a lesson, a sensor, a world and a command."""

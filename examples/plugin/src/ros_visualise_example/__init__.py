"""A node, a format, a drawing and a command for ros_visualise."""

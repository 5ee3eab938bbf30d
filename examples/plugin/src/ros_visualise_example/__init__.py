"""A node, a format, a drawing, a world and a command for ros_visualise."""

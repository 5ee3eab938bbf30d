"""Image processing as pure functions on numpy arrays: no ROS, no threads, no state."""

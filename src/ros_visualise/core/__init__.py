"""Foundations of all other packages; no ROS, no images."""

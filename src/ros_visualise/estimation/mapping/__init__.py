"""Mapping from a whole recording at once: the poses of camera and landmarks that fit all views."""

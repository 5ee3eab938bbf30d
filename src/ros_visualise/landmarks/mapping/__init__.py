"""A map from a whole recording at once: poses of the camera and of landmarks that fit all views."""

"""Localization in a map of landmarks: a filter that corrects odometry by what the camera sees."""

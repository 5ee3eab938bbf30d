"""Landmarks: detection of tags and objects in images, calibration, tracking, with uncertainty."""

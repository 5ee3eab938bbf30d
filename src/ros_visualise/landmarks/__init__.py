"""Landmarks: detection in images, localization, mapping and navigation, with uncertainty."""

"""Localization of landmarks: fusion of detections from many images, with consistent uncertainty."""

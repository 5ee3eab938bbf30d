"""Landmarks: finding them in images, and telling where they are and how sure that is."""

"""Tracking of many objects in images: one id for each, whatever detects them.

All positions are in pixels, whose origin is the centre of the top-left pixel; a box is the u and v
of its centre, its width and its height. Lengths of noise are relative to a box's mean side.
"""

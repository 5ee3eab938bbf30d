"""Rotations, transforms, the tree of frames, and positions on the Earth."""

"""Positions on the Earth of what a camera sees."""

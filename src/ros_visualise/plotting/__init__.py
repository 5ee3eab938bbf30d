"""Figures: drawn as SVG, PNG or text."""

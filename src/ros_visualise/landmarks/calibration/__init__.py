"""Calibrating a camera by pictures of a board: find the board, choose views, fit, and doubt."""

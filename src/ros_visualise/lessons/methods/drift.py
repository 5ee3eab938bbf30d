"""Drift of odometry: small errors of the heading, accumulated along the path."""

from __future__ import annotations

import numpy as np

from ros_visualise.data import Floats


def aligned(positions_xy: Floats, headings: Floats, start_xy: Floats, heading: float) -> Floats:
    """A path (N, 2), moved and rotated to begin at a point with a heading, radians."""
    angle = heading - headings[0]
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    moved: Floats = (positions_xy - positions_xy[0]) @ turn.T + start_xy
    return moved


def wrapped(angles: Floats) -> Floats:
    """Angles from -pi to pi."""
    small: Floats = (angles + np.pi) % (2 * np.pi) - np.pi
    return small


def error_by_heading(positions_xy: Floats, heading_errors: Floats) -> Floats:
    """(N,) metres by which a path deviates because of its headings alone.

    Each step of the true path is made in the direction of the wrong heading.

    Args:
        positions_xy: (N, 2) true positions.
        heading_errors: (N,) radians.
    """
    steps = np.diff(positions_xy, axis=0)
    middle = (heading_errors[1:] + heading_errors[:-1]) / 2
    cosine, sine = np.cos(middle), np.sin(middle)
    x, y = steps.T
    turned = np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=1)
    astray = np.cumsum(turned - steps, axis=0)
    return np.concatenate([[0.0], np.linalg.norm(astray, axis=1)])

"""Where in each world a mission's shape fits without touching an obstacle.

The areas are clear on the ground, so also for robots that fly, and so is the straight line to them
from where robots start.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

Pair = tuple[float, float]


class ClearArea(NamedTuple):
    """``center`` and ``size`` along x and y, metres in ``map``."""

    center: Pair
    size: Pair


_OPEN = ClearArea((0.0, 0.0), (8.0, 8.0))
_BESIDE_HELIPAD = ClearArea((-8.5, -2.25), (7.0, 5.5))
CLEAR_AREAS: Mapping[str, Mapping[str, ClearArea]] = {
    "plane": {"square": _OPEN, "figure_of_eight": _OPEN, "lawn_mower": _OPEN},
    "playpen": {
        "square": ClearArea((0.0, 0.0), (13.0, 5.0)),  # around the cones
        "figure_of_eight": ClearArea((0.0, 0.0), (14.0, 4.4)),
        "lawn_mower": ClearArea((0.0, 0.0), (3.0, 5.6)),  # between the cones
    },
    "field": {
        "square": _BESIDE_HELIPAD,
        "figure_of_eight": _BESIDE_HELIPAD,
        "lawn_mower": _BESIDE_HELIPAD,
    },
}
"""World -> shape -> where it fits."""

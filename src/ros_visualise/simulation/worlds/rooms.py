"""Where there is room for a shape: its middle and extent, clear of all that stands there.

What is said holds on the ground, so for those who fly too, as does the straight way there from
where robots are set down.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

Pair = tuple[float, float]


class Room(NamedTuple):
    """``center`` and ``size`` along x and y, metres in ``map``."""

    center: Pair
    size: Pair


_OPEN = Room((0.0, 0.0), (8.0, 8.0))
_BESIDE_HELIPAD = Room((-8.5, -2.25), (7.0, 5.5))
ROOMS: Mapping[str, Mapping[str, Room]] = {
    "plane": {"square": _OPEN, "figure_of_eight": _OPEN, "lawn_mower": _OPEN},
    "playpen": {
        "square": Room((0.0, 0.0), (13.0, 5.0)),  # around the cones
        "figure_of_eight": Room((0.0, 0.0), (14.0, 4.4)),
        "lawn_mower": Room((0.0, 0.0), (3.0, 5.6)),  # between the cones
    },
    "field": {
        "square": _BESIDE_HELIPAD,
        "figure_of_eight": _BESIDE_HELIPAD,
        "lawn_mower": _BESIDE_HELIPAD,
    },
}
"""World -> shape -> room for it."""

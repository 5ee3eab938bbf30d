"""The planes in which a movement is best seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ros_visualise.data import Floats

AXES = "xyz"
Plane = tuple[int, int]
"""The axes that go right and up."""

ALL: tuple[Plane, ...] = ((0, 1), (0, 2), (1, 2))
_JITTER = 0.05  # of the greatest extent: less is no movement
_THICK = 0.5  # of the second extent: a movement whose third is larger is in no plane


def planes_of(positions_xyz: Sequence[Floats], wanted: str = "auto") -> tuple[Plane, ...]:
    """Which planes to draw.

    Args:
        positions_xyz: of each path, (N, 3).
        wanted: ``xy``, ``xz``, ``yz``, ``all``, or ``auto``: that in which the paths move, and all
            of them where that is none.
    """
    if wanted == "all":
        return ALL
    if wanted != "auto":
        return ((AXES.index(wanted[0]), AXES.index(wanted[1])),)
    low = np.min([one.min(axis=0) for one in positions_xyz], axis=0)
    extent = np.max([one.max(axis=0) for one in positions_xyz], axis=0) - low
    extent[extent < _JITTER * extent.max()] = 0
    first, second, third = np.argsort(-extent, kind="stable").tolist()
    if extent[third] > _THICK * extent[second]:
        return ALL
    return ((min(first, second), max(first, second)),)


def other_axis(plane: Plane) -> int:
    """The axis that a plane lacks."""
    return 3 - sum(plane)

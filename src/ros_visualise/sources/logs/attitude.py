"""A vehicle's attitude over time."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.geometry import rotations
from ros_visualise.sources.logs.ned import to_attitude
from ros_visualise.sources.logs.ulog import Table

_HELD_US = 100_000


class Attitude:
    """The attitude at any time; it is held for a moment before the first sample and after the last.

    Args:
        table: ``vehicle_attitude``, or None where it was not logged.
    """

    def __init__(self, table: Table | None) -> None:
        none = np.zeros(0, np.int64)
        self.times_us = none if table is None else table.times_us
        if table is not None:
            quats = table.vector("q", 4)
            norms = np.linalg.norm(quats, axis=1)
            whole = (norms > 0.5) & (norms < 1.5)
            self.times_us = self.times_us[whole]
            self._quats = to_attitude(quats[whole])

    def is_known(self, times_us: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
        """(N,) whether it is known at these times."""
        if not len(self.times_us):
            return np.zeros(len(times_us), bool)
        first, last = self.times_us[[0, -1]]
        known: npt.NDArray[np.bool_] = np.logical_and(
            times_us >= first - _HELD_US, times_us <= last + _HELD_US
        )
        return known

    def at(self, times_us: npt.NDArray[np.int64]) -> Floats:
        """(N, 4) x, y, z, w; where it is not known, that of the map."""
        if not len(self.times_us):
            return np.tile([0.0, 0.0, 0.0, 1.0], (len(times_us), 1))
        places = np.interp(times_us, self.times_us, np.arange(len(self.times_us)))
        before = places.astype(int)
        after = np.minimum(before + 1, len(self.times_us) - 1)
        return rotations.slerp(self._quats[before], self._quats[after], places - before)

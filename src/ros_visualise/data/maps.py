"""Maps of the ground, and outlines on it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from ros_visualise.data.header import Floats, Header, keep


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """How likely the cells of a grid are occupied, or how much it costs to be in them.

    ``cells`` (height, width) int8: 0 is free, 100 occupied, -1 unknown; squares of ``resolution``
    metres. Rows go along the y axis of the grid's own frame, columns along x; its origin, the outer
    corner of ``cells[0, 0]``, is at ``position_xyz`` (3,) metres and ``quat_xyzw`` (4,) in the
    frame of the header. ``loaded_ns`` is when the map was loaded, in nanoseconds.
    """

    cells: npt.NDArray[np.int8]
    resolution: float
    position_xyz: Floats = field(default_factory=lambda: np.zeros(3))
    quat_xyzw: Floats = field(default_factory=lambda: np.array([0.0, 0, 0, 1]))
    loaded_ns: int = 0
    header: Header = Header()

    def __post_init__(self) -> None:
        if self.cells.ndim != 2:
            raise ValueError(f"OccupancyGrid.cells is {self.cells.shape}, not (height, width)")
        keep(self, np.int8, cells=self.cells.shape)
        keep(self, position_xyz=(3,), quat_xyzw=(4,))

    @property
    def nbytes(self) -> int:
        """Bytes of its cells."""
        return int(self.cells.nbytes)


@dataclass(frozen=True, eq=False)
class PolygonStamped:
    """Corners (N, 3) in metres in the frame of the header; the last one joins the first.

    The outline of a robot on the ground is sent as such.
    """

    points_xyz: npt.NDArray[np.float32]
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(self, np.float32, points_xyz=(len(self.points_xyz), 3))

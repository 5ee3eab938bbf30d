"""Scans of KITTI's Velodyne."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Header, PointCloud
from ros_visualise.sources.kitti.files import Files
from ros_visualise.sources.series import DamagedFile

_POINT = np.dtype([(name, np.float32) for name in ("x", "y", "z", "intensity")])


class Scanner:
    """The scans, each stamped with the time at which the scanner looked ahead.

    Points are in metres; intensity is 0 to 1. The times at which a turn began and ended are
    published beside them. Points have no times of their own: KITTI's files do not keep their order.

    Args:
        files: of four 32-bit floats a point; or of text, as unsynced drives have them.
        stamps_ns: (N,).
    """

    def __init__(self, files: Files, stamps_ns: npt.NDArray[np.int64], frame_id: str) -> None:
        self._files, self._stamps_ns, self._frame_id = files, stamps_ns, frame_id

    def cloud(self, index: int) -> PointCloud:
        """One turn of the scanner.

        Raises:
            DamagedFile: it does not end with a whole point, or is no scan.
        """
        rows = self._rows(index)
        header = Header(int(self._stamps_ns[index]), self._frame_id)
        return PointCloud(rows.view(_POINT)[:, 0], bool(np.isfinite(rows).all()), header)

    def _rows(self, index: int) -> npt.NDArray[np.float32]:
        path, data = self._files.path(index), self._files.read(index)
        if path.suffix == ".txt":
            try:
                numbers = np.array(data.split(), np.float32)
            except ValueError:
                raise DamagedFile(path, "holds more than numbers") from None
            if numbers.size % 4:
                raise DamagedFile(path, "cut off")
            return numbers.reshape(-1, 4)
        if len(data) % _POINT.itemsize:
            raise DamagedFile(path, "cut off, or no scan: it does not end with a whole point")
        return np.frombuffer(data, np.dtype("<f4")).reshape(-1, 4)

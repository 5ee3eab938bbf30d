"""Text files of trajectories, as evo and the KITTI and TUM benchmarks read them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path as File

from ros_visualise.core.errors import RecordingError
from ros_visualise.core.printing import in_seconds
from ros_visualise.data import Path
from ros_visualise.geometry.se3 import from_pose
from ros_visualise.sinks.files import TargetFile


def save(files: Mapping[File, bytes], overwrite: bool) -> None:
    """Write all of these files, or none.

    Raises:
        OpenError: one exists or cannot be written.
        RecordingError: one cannot be written to its end.
    """
    pending: dict[File, TargetFile] = {}
    try:
        for file, data in files.items():
            pending[file] = TargetFile(file, overwrite)
            pending[file].write(data)
        for file in files:
            pending[file].close()
            del pending[file]
    except OSError as error:
        raise RecordingError(f"{file}: {error.strerror}; nothing was written") from None
    finally:
        for target in pending.values():
            target.remove()


def _tum(path: Path) -> Iterator[str]:
    rows = zip(
        path.stamps_ns.tolist(),
        path.positions_xyz.tolist(),
        path.quats_xyzw.tolist(),
        strict=True,
    )
    for stamp_ns, position, quat in rows:
        yield f"{in_seconds(stamp_ns)} {_numbers([*position, *quat])}\n"


def _kitti(path: Path) -> Iterator[str]:
    for T in from_pose(path.positions_xyz, path.quats_xyzw):
        yield _numbers(T[:3].ravel().tolist()) + "\n"


FORMATS: dict[str, Callable[[Path], Iterator[str]]] = {"tum": _tum, "kitti": _kitti}
"""Name -> the lines of a path; who reads them gets the same numbers.

``tum`` has ``time x y z qx qy qz qw``, the time in seconds with all its digits; ``kitti`` the upper
three rows of T_frame_pose, and no times.
"""


def _numbers(values: list[float]) -> str:
    return " ".join(map(repr, values))

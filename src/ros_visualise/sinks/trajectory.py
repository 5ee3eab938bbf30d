"""Text files of trajectories, as evo and the KITTI and TUM benchmarks read them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path as File

from ros_visualise.data import Path
from ros_visualise.errors import RecordingError
from ros_visualise.geometry.transforms import from_pose
from ros_visualise.sinks.files import TargetFile, already_there, no_folder

_NS = 1_000_000_000


def check_target(file: File, overwrite: bool) -> None:
    """Say early that a file will not be written, before another is.

    Raises:
        OpenError: it exists and is not to be replaced, or there is no folder for it.
    """
    if file.exists() and not overwrite:
        raise already_there(file)
    if not file.parent.exists():
        raise no_folder(file)


def save(file: File, data: bytes, overwrite: bool) -> None:
    """Write a file as a whole or not at all.

    Raises:
        OpenError: it exists or cannot be written.
        RecordingError: it cannot be written to its end.
    """
    target = TargetFile(file, overwrite)
    try:
        target.write(data)
        target.close()
    except OSError as error:
        target.remove()
        raise RecordingError(f"{file}: {error.strerror}; nothing was kept") from None


def _tum(path: Path) -> Iterator[str]:
    rows = zip(
        path.stamps_ns.tolist(),
        path.positions_xyz.tolist(),
        path.quats_xyzw.tolist(),
        strict=True,
    )
    for stamp_ns, position, quat in rows:
        yield f"{_seconds(stamp_ns)} {_numbers([*position, *quat])}\n"


def _kitti(path: Path) -> Iterator[str]:
    for T in from_pose(path.positions_xyz, path.quats_xyzw):
        yield _numbers(T[:3].ravel().tolist()) + "\n"


FORMATS: dict[str, Callable[[Path], Iterator[str]]] = {"tum": _tum, "kitti": _kitti}
"""Name -> the lines of a path; who reads them gets the same numbers.

``tum`` has ``time x y z qx qy qz qw``, the time in seconds with all its digits; ``kitti`` the upper
three rows of T_frame_pose, and no times.
"""


def _seconds(stamp_ns: int) -> str:
    """Exact decimals: a number of 64 bits has no nanoseconds of the seconds since 1970."""
    sign = "-" if stamp_ns < 0 else ""
    return f"{sign}{abs(stamp_ns) // _NS}.{abs(stamp_ns) % _NS:09d}"


def _numbers(values: list[float]) -> str:
    return " ".join(map(repr, values))

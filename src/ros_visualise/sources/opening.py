"""Opening a recording: what a path is, is found out by looking at it, whatever its name."""

from __future__ import annotations

import os
import re
from pathlib import Path

from ros_visualise.errors import OpenError
from ros_visualise.regular_files import open_file
from ros_visualise.sources.logs.srt import begins_srt
from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.recordings.metadata import METADATA

_ROSBAG1 = b"#ROSBAG V"
_MCAP = b"\x89MCAP0\r\n"
_SQLITE = b"SQLite format 3\0"
_ULOG = b"ULog\x01\x12\x35"
_ARCHIVES = (b"PK\x03\x04", b"\x1f\x8b", b"BZh", b"\xfd7zXZ", b"\x28\xb5\x2f\xfd", b"7z\xbc\xaf")
"""How zip, gzip, bzip2, xz, zstd and 7z begin."""
_HEAD_SIZE = 4096
_MOST_METADATA = 4 << 20  # bytes
_NAMED = {
    ".bag": "ROS 1 bag",
    ".mcap": "MCAP file",
    ".db3": "ROS 2 bag's SQLite file",
    ".ulg": "PX4 flight log (ULog)",
    ".srt": "file of a DJI camera's subtitles",
}
"""How a name ends -> what a file of that name is."""
SUFFIXES = tuple(_NAMED)
KINDS = ".bag, .mcap, .db3, .ulg, .SRT, a ROS 2 or KITTI folder"
"""The recordings that there are, for people."""

_LISTED = 3  # of the recordings in a folder, or of what is lost, so many are named


class NoRecording(OpenError):
    """A folder has no recording in it."""


def open_recording(path: str | Path) -> Recording:
    """Open what is there.

    Raises:
        OpenError: there is nothing, or nothing that can be read; the message says what to do.
    """
    path = Path(path)
    try:
        recording = _open_folder(path) if path.is_dir() else _open_file(path)
    except PermissionError:
        raise OpenError(f"{path}: you may not read it; try chmod u+rX") from None
    except OSError as error:
        raise OpenError(f"{path}: {error.strerror or error}; check the path") from None
    if recording.loss and not any(topic.messages for topic in recording.topics.values()):
        recording.close()
        why = "; ".join(recording.loss.notes[:_LISTED])
        raise OpenError(f"{path}: no message of it can be read; copy or record it again ({why})")
    return recording


def is_recording(path: str | Path) -> bool:
    """Whether there is something for `open_recording`, be it damaged; a video is none."""
    path = Path(path)
    try:
        return path.is_dir() or (path.is_file() and _kind(_head(path)) != "")
    except OSError:
        return False


def unknown_file(path: Path, what: str, hint: str) -> OpenError:
    """What to say of a file that nobody here can read.

    Args:
        what: it is, where neither its beginning nor its name tells more.
        hint: what to do, unless it is packed.
    """
    if _head(path).startswith(_ARCHIVES):
        return OpenError(f"{path}: a packed file; unpack it and give what is in it")
    named = _NAMED.get(path.suffix.lower())
    if named:
        what = f"no {named}, though its name ends so"
    return OpenError(f"{path}: {what}; {hint}")


def _open_file(path: Path) -> Recording:
    if not path.exists():
        raise OpenError.missing(path)
    if not path.is_file():
        raise OpenError(
            f"{path}: not a regular file; for a camera run: ros-visualise camera {path}"
        )
    head = _head(path)
    if not head:
        raise OpenError(f"{path}: an empty file; copy or record it again")
    match _kind(head):
        case "rosbag1":
            from ros_visualise.sources.recordings.rosbag1 import open_rosbag1

            return open_rosbag1(path)
        case "mcap":
            from ros_visualise.sources.recordings.mcap_file import open_mcap

            return open_mcap(path)
        case "sqlite":
            from ros_visualise.sources.recordings.rosbag2 import open_rosbag2

            return open_rosbag2(path.parent if _is_listed(path) else path)
        case "ulog":
            from ros_visualise.sources.logs.px4 import open_ulog

            return open_ulog(path)
        case "srt":
            from ros_visualise.sources.logs.dji import open_srt

            return open_srt(path)
    raise unknown_file(
        path, f"not a recording ({KINDS})", f"if it is a video: ros-visualise video {path}"
    )


def _open_folder(path: Path) -> Recording:
    from ros_visualise.sources.kitti import find_whole, is_kitti, open_kitti
    from ros_visualise.sources.recordings.rosbag1 import is_split_bag, open_rosbag1
    from ros_visualise.sources.recordings.rosbag2 import open_rosbag2

    if (path / METADATA).is_file():
        return open_rosbag2(path)
    if is_kitti(path):
        return open_kitti(path)
    found = _recordings_in(path)
    if found and _is_one_split_bag(found):
        return open_rosbag2(path)
    if len(found) > 1 and is_split_bag(found):
        return open_rosbag1(path)
    whole = None if found else find_whole(path)
    if whole is not None:
        raise OpenError(f"{path}: a part of a KITTI drive; give the whole: {whole}")
    if not found:
        raise NoRecording(f"{path}: a folder with no recording in it; give a file or folder of one")
    if len(found) == 1:
        return _open_folder(found[0]) if found[0].is_dir() else _open_file(found[0])
    names = ", ".join(item.name for item in found[:_LISTED])
    more = f" and {len(found) - _LISTED} more" if len(found) > _LISTED else ""
    raise OpenError(f"{path}: a folder with {names}{more} in it; choose, for instance {found[0]}")


def _recordings_in(folder: Path) -> list[Path]:
    items = sorted(folder.iterdir())
    return [
        item
        for item in items
        if ((item / METADATA).is_file() if item.is_dir() else is_recording(item))
    ]


def _is_one_split_bag(files: list[Path]) -> bool:
    """Whether they are what ROS 2 leaves of one bag: ``NAME_0.db3``, ``NAME_1.db3``, ..."""
    names = {re.sub(r"_\d+(?=\.\w+$)", "", file.name) for file in files}
    return len(names) == 1 and {file.suffix for file in files} <= {".db3", ".mcap"}


def _is_listed(path: Path) -> bool:
    metadata = path.parent / METADATA
    if not metadata.is_file():
        return False
    with open_file(metadata) as file:
        return os.fsencode(path.name) in file.read(_MOST_METADATA)


def _head(path: Path) -> bytes:
    with open_file(path) as file:
        return file.read(_HEAD_SIZE)


def _kind(head: bytes) -> str:
    magics = {_ROSBAG1: "rosbag1", _MCAP: "mcap", _SQLITE: "sqlite", _ULOG: "ulog"}
    for magic, kind in magics.items():
        if head.startswith(magic):
            return kind
    return "srt" if begins_srt(head) else ""

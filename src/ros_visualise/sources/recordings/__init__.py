"""Recordings of many topics: bags, MCAP files, KITTI folders, flight logs.

`open_recording` finds out what a path is by looking at it, whatever its name.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Generator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ros_visualise.errors import OpenError
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sources.logs.srt import begins_srt

_ROSBAG1 = b"#ROSBAG V"
_MCAP = b"\x89MCAP0\r\n"
_SQLITE = b"SQLite format 3\0"
_ULOG = b"ULog\x01\x12\x35"
_ARCHIVES = (b"PK\x03\x04", b"\x1f\x8b", b"BZh", b"\xfd7zXZ", b"\x28\xb5\x2f\xfd", b"7z\xbc\xaf")
"""How zip, gzip, bzip2, xz, zstd and 7z begin."""
_HEAD_SIZE = 4096
_NAMED = {
    ".bag": "ROS 1 bag",
    ".mcap": "MCAP file",
    ".db3": "ROS 2 bag's SQLite file",
    ".ulg": "PX4 flight log (ULog)",
    ".srt": "file of a DJI camera's subtitles",
}
"""How a name ends -> what a file of that name is."""
KINDS = ".bag, .mcap, .db3, .ulg, .SRT, a ROS 2 or KITTI folder"
"""The recordings that there are, for people."""

_LISTED = 3  # of the recordings in a folder, so many are named


class Entry(NamedTuple):
    """One message of a recording, and when it was recorded.

    ``message`` is a `ros_visualise.messages.recorded.Recorded` or, where the recording holds no ROS
    messages, one of `ros_visualise.data.MESSAGES`.
    """

    topic: str
    stamp_ns: int
    message: Any


@dataclass(frozen=True)
class TopicInfo:
    """What a recording says of a topic; ``messages`` counts those that are there.

    ``digest`` is the MD5 or hash of its type as the recording has it. ``unreadable`` is empty,
    or says why its messages can not be read. ``other_types``: name -> digest of those whose
    messages are left out, as the topic is of ``type``.
    """

    type: TopicType
    messages: int
    digest: str = ""
    connections: int = 1
    unreadable: str = ""
    other_types: Mapping[str, str] = field(default_factory=dict)


def left_out(topic: str, messages: int, type_name: str, chosen: str) -> str:
    """What to say of messages of another type than the ``chosen`` one, that of their topic."""
    difference = f"of {chosen}" if type_name != chosen else "of another one by that name"
    noun = "message" if messages == 1 else "messages"
    return f"{topic}: {messages} {noun} of {type_name} left out: the topic is {difference}"


@dataclass
class Loss:
    """What of a recording could not be read, as far as it was read by now.

    ``notes`` are for people, a line each: ``cut off after 12.3 of 40.1 MB``.
    """

    messages: int = 0
    bytes: int = 0
    notes: list[str] = field(default_factory=list)

    def __bool__(self) -> bool:
        return bool(self.messages or self.bytes or self.notes)


class Recording(Protocol):
    """An opened recording; one thread at a time reads it.

    Attributes:
        path: the file or folder.
        format: for people and ``info``: ``rosbag 2.0``, ``mcap``, ``rosbag2``, ``KITTI raw``.
        size: bytes of all its files.
        start_ns, end_ns: stamps of the first and the last message; equal where there is none.
        topics: by name, in the order of their names.
        loss: what could not be read.
    """

    path: Path
    format: str
    size: int
    start_ns: int
    end_ns: int
    topics: Mapping[str, TopicInfo]
    loss: Loss

    @property
    def compression(self) -> str:
        """``none``, ``lz4``, ``bz2``, ``zstd``, or several joined by ``, ``."""

    def read(
        self,
        start_ns: int | None = None,
        stop_ns: int | None = None,
        topics: Collection[str] | None = None,
    ) -> Generator[Entry, None, None]:
        """The messages in order of their stamps; of equal stamps, in the order of the file.

        Args:
            start_ns, stop_ns: the first stamp, and the one before which to end; absolute times.
            topics: of these alone.
        """

    def stamps_ns(self) -> Mapping[str, NDArray[np.int64]]:
        """The stamps of each topic's messages in their order, from the index where there is one."""

    def close(self) -> None:
        """Let go of its files; may be called from any thread, and ends what is being read."""


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
        raise OpenError(f"{path}: no message of it can be read; copy or record it again")
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
        raise OpenError(f"{path}: no file; a camera is shown by: ros-visualise camera {path}")
    head = _head(path)
    if not head:
        raise OpenError(f"{path}: an empty file; copy or record it again")
    match _kind(head):
        case "rosbag1":
            from ros_visualise.sources.recordings.rosbag1 import open_rosbag1

            return open_rosbag1(path)
        case "mcap":
            from ros_visualise.sources.recordings.mcap import open_mcap

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
    from ros_visualise.sources.recordings.rosbag2 import open_rosbag2

    if (path / "metadata.yaml").is_file():
        return open_rosbag2(path)
    if is_kitti(path):
        return open_kitti(path)
    found = _recordings_in(path)
    if found and _is_one_split_bag(found):
        return open_rosbag2(path)
    whole = None if found else find_whole(path)
    if whole is not None:
        raise OpenError(f"{path}: a part of a KITTI drive; give the whole: {whole}")
    if not found:
        raise OpenError(f"{path}: a folder with no recording in it; give a file or folder of one")
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
        if ((item / "metadata.yaml").is_file() if item.is_dir() else is_recording(item))
    ]


def _is_one_split_bag(files: list[Path]) -> bool:
    """Whether they are what ROS 2 leaves of one bag: ``NAME_0.db3``, ``NAME_1.db3``, ..."""
    names = {re.sub(r"_\d+(?=\.\w+$)", "", file.name) for file in files}
    return len(names) == 1 and {file.suffix for file in files} <= {".db3", ".mcap"}


def _is_listed(path: Path) -> bool:
    metadata = path.parent / "metadata.yaml"
    return metadata.is_file() and path.name in metadata.read_text(errors="replace")


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(_HEAD_SIZE)


def _kind(head: bytes) -> str:
    magics = {_ROSBAG1: "rosbag1", _MCAP: "mcap", _SQLITE: "sqlite", _ULOG: "ulog"}
    for magic, kind in magics.items():
        if head.startswith(magic):
            return kind
    return "srt" if begins_srt(head) else ""

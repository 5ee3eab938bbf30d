"""How many messages somebody else's reader finds, be it before it gives up."""

import math
import sqlite3
import struct
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import av
import cv2
from mcap.records import Message
from mcap.stream_reader import StreamReader
from rosbags.rosbag1 import Reader

_MOST_PIXELS = 2**24  # OpenCV believes what is said


def count(path: Path, kind: str) -> int | None:
    """At least so many there are; None where there is no other reader of that kind."""
    if kind not in _READERS:
        return None
    found = 0
    with suppress(Exception):  # readers of others raise whatever they like
        for _ in _READERS[kind](path):
            found += 1
    return found


def _bag(path: Path) -> Iterator[Any]:
    with Reader(path) as reader:
        yield from reader.messages()


def _mcap(path: Path) -> Iterator[Any]:
    with path.open("rb") as file:
        reader = StreamReader(file, record_size_limit=2**30)
        yield from (record for record in reader.records if isinstance(record, Message))


def _mcap_folder(path: Path) -> Iterator[Any]:
    for file in sorted(path.glob("*.mcap")):
        yield from _mcap(file)


def _sqlite_folder(path: Path) -> Iterator[Any]:
    for file in sorted(path.glob("*.db3")):
        with closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True)) as base:
            yield from base.execute("SELECT m.data FROM messages m JOIN topics t ON topic_id=t.id")


def _video(path: Path) -> Iterator[Any]:
    """Its frames; of several for the same time, one can be shown."""
    times = set()
    with av.open(str(path)) as container:
        for packet in container.demux(video=0):
            with suppress(av.FFmpegError):
                times |= {frame.pts for frame in packet.decode()}
    yield from times


def _drive(path: Path) -> Iterator[Any]:
    """Each of the sensors' files that is whole is a message or more."""
    for file in path.rglob("*"):
        whole = False
        if file.stem.isdigit() and file.suffix in _IS_WHOLE:
            with suppress(ValueError, struct.error):
                whole = _IS_WHOLE[file.suffix](file)
        if whole:
            yield file


def _is_image(file: Path) -> bool:
    width, height = struct.unpack(">II", file.read_bytes()[16:24])
    return width * height < _MOST_PIXELS and cv2.imread(str(file), -1) is not None


def _is_scan(file: Path) -> bool:
    size = file.stat().st_size
    return size > 0 and size % 16 == 0


def _is_oxts(file: Path) -> bool:
    return (
        file.parent.name == "data"
        and sum(map(math.isfinite, map(float, file.read_text().split()))) == 30
    )


_IS_WHOLE = {".png": _is_image, ".bin": _is_scan, ".txt": _is_oxts}
_READERS = {
    "bag": _bag,
    "mcap": _mcap,
    "mcap_folder": _mcap_folder,
    "db3": _sqlite_folder,
    "video": _video,
    "kitti": _drive,
    "kitti_odometry": _drive,
}

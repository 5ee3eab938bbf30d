"""Recordings of many topics: bags, MCAP files, KITTI folders, flight logs; what all of them are.

`ros_visualise.sources.opening.open_recording` opens one.
"""

from __future__ import annotations

from collections.abc import Collection, Generator, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from mcap.records import Attachment, Metadata
from numpy.typing import NDArray

from ros_visualise.messages.recorded import TopicType

Extra = Attachment | Metadata
"""What a recording holds beside its messages: a file, or texts by name; as MCAP has them."""


class Entry(NamedTuple):
    """One message of a recording, and when it was recorded.

    ``message`` is a `ros_visualise.messages.recorded.Recorded` or, where the recording holds no ROS
    messages, one of `ros_visualise.data`.
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

    ``notes`` are for people, a line each: ``cut off after 12.3 of 40.1 MB``. There is one wherever
    something is lost, also where nobody knows how much.
    """

    messages: int = 0
    bytes: int = 0
    notes: list[str] = field(default_factory=list)

    def __bool__(self) -> bool:
        return bool(self.notes)


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

    def extras(self) -> Iterator[Extra]:
        """What it holds beside its messages, in the order of the file; damaged ones are a loss."""

    def close(self) -> None:
        """Let go of its files; may be called from any thread, and ends what is being read."""

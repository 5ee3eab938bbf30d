"""Where in a chunk of a ROS 1 bag the bytes of its messages are."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ros_visualise.sources.recordings.chunk_piece import Place
from ros_visualise.sources.recordings.rosbag1 import records
from ros_visualise.sources.recordings.rosbag1.chunks import Content
from ros_visualise.sources.recordings.rosbag1.records import Damaged, Op

_LENGTH = b"\x26\0\0\0"
_FIELDS = (b"\x09\0\0\0conn=????", b"\x04\0\0\0op=\x02", b"\x0d\0\0\0time=????????")
_HEADS = [
    np.frombuffer(_LENGTH + b"".join(order), np.uint8) for order in itertools.permutations(_FIELDS)
]
"""A message's header with its fields in any order; what differs from message to message is ``?``.

Writers put them into the order that their language happens to give.
"""
_HEAD_BYTES = 42
_SIZED_HEAD = np.arange(_HEAD_BYTES + 4)


def locate(
    content: Content,
    entries: NDArray[Any],
    spans: NDArray[np.int64],
    lose: Callable[[int, str], None],
) -> list[Place]:
    """The places of messages, in their order; without those that are not where the index has them.

    Args:
        entries: (N,) of `ENTRY`.
        spans: (3, N) theirs, as `common_spans` gives them.
        lose: told the offset of each that is not there, and why.
    """
    starts, sizes, _ = spans
    for i in np.flatnonzero(starts < 0):
        _, connection, offset = entries[i].tolist()
        try:
            starts[i], sizes[i] = _any(content, connection, offset)
        except Damaged as damage:
            lose(offset, str(damage))
    there = starts >= 0
    stamps_ns, starts = entries["stamp_ns"][there].tolist(), starts[there]
    stops = (starts + sizes[there]).tolist()
    numbers = entries["connection"][there].tolist()
    return list(
        zip(
            stamps_ns, numbers, starts.tolist(), stops, stamps_ns, itertools.repeat(0), strict=False
        )
    )


def gaps(
    content: Content, entries: NDArray[Any], spans: NDArray[np.int64]
) -> Iterator[tuple[int, int]]:
    """Where in a chunk in memory no message lies that its index names: from where to where."""
    known = spans[0] >= 0
    order = np.argsort(entries["offset"][known])
    begins = entries["offset"][known][order].astype(np.int64)
    ends = spans[:2].sum(axis=0)[known][order]
    if content.data is None or not known.all():
        return
    lefts, rights = np.append(0, ends), np.append(begins, len(content.data))
    for place in np.flatnonzero(lefts < rights):
        yield int(lefts[place]), int(rights[place])


def common_spans(content: Content, entries: NDArray[Any]) -> NDArray[np.int64]:
    """(3, N) starts, sizes and stamps of messages whose header has just its three fields; else -1.

    The stamps are the messages' own, in nanoseconds.
    """
    starts, sizes, stamps_ns = np.full((3, len(entries)), -1, np.int64)
    data = np.frombuffer(content.data or b"", np.uint8)
    offsets = entries["offset"].astype(np.int64)
    for head in _HEADS:
        [left] = np.nonzero((starts < 0) & (offsets <= len(data) - len(_SIZED_HEAD)))
        if not len(left):
            break
        found = data[offsets[left, None] + _SIZED_HEAD]
        connection = bytes(head).index(b"conn=") + len(b"conn=")
        fixed = np.flatnonzero(head != ord("?"))
        is_one = (found[:, fixed] == head[fixed]).all(axis=1)
        is_one &= _numbers(found, connection) == entries["connection"][left]
        found_starts, found_sizes = offsets[left] + len(_SIZED_HEAD), _numbers(found, _HEAD_BYTES)
        is_one &= found_starts + found_sizes <= len(data)
        starts[left[is_one]], sizes[left[is_one]] = found_starts[is_one], found_sizes[is_one]
        time = bytes(head).index(b"time=") + len(b"time=")
        found_ns = _numbers(found, time) * 1_000_000_000 + _numbers(found, time + 4)
        stamps_ns[left[is_one]] = found_ns[is_one]
    return np.stack([starts, sizes, stamps_ns])


def _numbers(heads: NDArray[np.uint8], at: int) -> NDArray[np.int64]:
    found: NDArray[np.uint32] = np.ascontiguousarray(heads[:, at : at + 4]).view("<u4")[:, 0]
    return found.astype(np.int64)


def _any(content: Content, connection: int, offset: int) -> tuple[int, int]:
    """Start and size of one message, whatever its header is like.

    Raises:
        Damaged: there is one of another topic, or none.
    """
    file, start, end = content[:3]
    record = records.read_record(file, start + offset, end)
    while record.op == Op.CONNECTION:  # some indexes point to the one before the message
        record = records.read_record(file, record.end, end)
    if record.op != Op.MESSAGE or records.number(record.fields, b"conn") != connection:
        raise Damaged("another message than the index says")
    if record.end > end:
        raise Damaged("a message that is longer than its chunk")
    return record.data_position - start, record.data_size

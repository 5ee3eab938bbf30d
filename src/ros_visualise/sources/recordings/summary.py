"""Summary of a recording, in figures."""

from __future__ import annotations

from collections import Counter
from contextlib import closing
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import Image
from ros_visualise.messages.recorded import content
from ros_visualise.sources.recordings import Recording, TopicInfo


def summarize(recording: Recording) -> dict[str, Any]:
    """Summary as ``ros-visualise info --json`` prints it; times in seconds, size in bytes.

    A topic's ``hz`` is None if it has too few messages for one.
    """
    stamps = recording.stamps_ns()
    topics = {name: _topic(topic, stamps[name]) for name, topic in recording.topics.items()}
    loss = recording.loss
    return {
        "path": str(recording.path),
        "format": recording.format,
        "start": recording.start_ns / 1e9,
        "end": recording.end_ns / 1e9,
        "duration": (recording.end_ns - recording.start_ns) / 1e9,
        "size": recording.size,
        "messages": sum(topic.messages for topic in recording.topics.values()),
        "compression": recording.compression,
        "types": _types(recording),
        "topics": topics,
        "lost": {"messages": loss.messages, "bytes": loss.bytes, "notes": list(loss.notes)},
    }


def read_through(recording: Recording) -> None:
    """Read and decode all messages, so that its ``loss`` includes damage that no index shows."""
    damaged: Counter[str] = Counter()
    reasons: dict[str, str] = {}
    with closing(recording.read()) as entries:
        for entry in entries:
            if recording.topics[entry.topic].unreadable:
                continue
            try:
                message = content(entry.message)
                _ = message.pixels if isinstance(message, Image) else message
            except DamagedMessage as error:
                damaged[entry.topic] += 1
                reasons.setdefault(entry.topic, str(error))
    for topic, count in damaged.items():
        recording.loss.messages += count
        noun = "message" if count == 1 else "messages"
        recording.loss.notes.append(f"{topic}: {count} {noun} cannot be read: {reasons[topic]}")


def mean_rate(stamps_ns: NDArray[np.int64]) -> float | None:
    """Messages in a second by the median of the times between them, as ``rosbag info`` has it.

    None if there are fewer than two, or most have the same stamp.
    """
    if len(stamps_ns) < 2:
        return None
    period_ns = float(np.median(np.diff(stamps_ns)))
    return round(1e9 / period_ns, 4) if period_ns > 0 else None


def _topic(topic: TopicInfo, stamps_ns: NDArray[np.int64]) -> dict[str, Any]:
    found: dict[str, Any] = {
        "type": topic.type.name,
        "messages": topic.messages,
        "hz": mean_rate(stamps_ns),
        "connections": topic.connections,
    }
    if topic.unreadable:
        found["unreadable"] = topic.unreadable
    return found


def _types(recording: Recording) -> dict[str, str]:
    found: dict[str, str] = {}
    for topic in recording.topics.values():
        for name, digest in {**topic.other_types, topic.type.name: topic.digest}.items():
            found.setdefault(name, digest)
    return dict(sorted(found.items()))

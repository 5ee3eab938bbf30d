"""The camera's calibration of each recorded image."""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Mapping
from contextlib import closing

from ros_visualise.messages.calibrations import CAMERA_INFO, calibration_topic
from ros_visualise.messages.recorded import Recorded
from ros_visualise.sources.recordings import Entry, TopicInfo

Read = Callable[[int | None, int | None, Collection[str] | None], Generator[Entry, None, None]]
"""Signature of `Recording.read`."""

_LOOK_BACK_NS = 1_000_000_000


def calibrated(
    read: Read,
    known: Mapping[str, TopicInfo],
    start_ns: int | None,
    stop_ns: int | None,
    wanted: Collection[str] | None,
) -> Generator[Entry, None, None]:
    """The entries of ``read``, each image with its camera's calibration: the last one before it.

    An image before every calibration gets the first one. Calibrations that are not wanted are read
    for the images, and dropped. Times and topics: see `Recording.read`.
    """
    types = {topic: info.type for topic, info in known.items()}
    infos = {
        topic: info
        for topic in types
        if (wanted is None or topic in wanted) and (info := calibration_topic(topic, types))
    }
    topics = None if wanted is None else {*wanted, *infos.values()}
    last: dict[str, Recorded | None] = {}
    with closing(read(start_ns, stop_ns, topics)) as entries:
        for entry in entries:
            message = entry.message
            if isinstance(message, Recorded):
                if message.type_name == CAMERA_INFO.name:
                    last[entry.topic] = message
                elif entry.topic in infos:
                    info = infos[entry.topic]
                    if info not in last:
                        last[info] = _nearest(read, info, start_ns)
                    message.calibration = last[info]
            if wanted is None or entry.topic in wanted:
                yield entry


def _nearest(read: Read, topic: str, time_ns: int | None) -> Recorded | None:
    """The last message before a time, else the first of all."""
    span_ns = _LOOK_BACK_NS
    while time_ns is not None and span_ns < 2 * time_ns:
        found = None
        with closing(read(max(0, time_ns - span_ns), time_ns, [topic])) as entries:
            for entry in entries:
                found = entry.message
        if isinstance(found, Recorded):
            return found
        span_ns *= 8
    with closing(read(None, None, [topic])) as entries:
        first = next(entries, None)
    return first.message if first and isinstance(first.message, Recorded) else None

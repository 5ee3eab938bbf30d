"""Images of a recording to be processed: by default the first gray or colour ones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from typing import Any

from ros_visualise.core.errors import DamagedMessage, UsageError
from ros_visualise.data import ENCODINGS, Image
from ros_visualise.messages.calibrations import calibration_topic
from ros_visualise.messages.recorded import content
from ros_visualise.sources.recordings import Recording


def first_image(recording: Recording, topics: Sequence[str]) -> str | None:
    """The first of some topics whose first image is gray or in colours, else the first.

    Only the messages distinguish these from depth and the like. Empty topics do not count.
    """
    filled = [topic for topic in topics if recording.topics[topic].messages]
    if len(filled) > 1:
        for topic in filled:
            if _is_picture(recording, topic):
                return topic
    return next(iter(filled), None)


def own_cameras(recording: Recording, first: str, topics: Sequence[str]) -> list[str]:
    """The topics of cameras: the first, and those with a calibration and a frame of their own.

    Args:
        recording: it is open.
        first: one of the topics.
        topics: all of images, or all of detections.
    """
    types = {name: topic.type for name, topic in recording.topics.items()}
    found, frames = [first], {_frame(recording, first)}
    for topic in topics:
        if topic != first and calibration_topic(topic, types) and recording.topics[topic].messages:
            frame = _frame(recording, topic)
            if frame and frame not in frames:
                frames.add(frame)
                found.append(topic)
    return found


def image_topic(recording: Recording, wanted: str | None) -> str:
    """The wanted topic of images, else the first in gray or colours.

    Raises:
        UsageError: no such topic; the message lists all topics of images.
    """
    topics = [name for name, topic in recording.topics.items() if topic.type.data_class is Image]
    if wanted in topics:
        return str(wanted)
    if wanted is not None:
        there = f"choose from {', '.join(topics)}" if topics else "it has no images"
        raise UsageError(f"{recording.path}: no image topic {wanted}; {there}")
    found = first_image(recording, topics)
    if found is None:  # some films do not say how many images they have
        found = next((topic for topic in topics if _first_message(recording, topic)), None)
    if found is None:
        raise UsageError(f"{recording.path}: holds no images")
    return found


def recorded_images(
    recording: Recording, topic: str, most: int | None = None
) -> Iterator[tuple[int, Image]]:
    """(Stamp, image) of a topic, if decodable; ``most``: about so many, evenly spread over time."""
    period_ns = (recording.end_ns - recording.start_ns) // most if most else 0
    next_ns = recording.start_ns
    with closing(recording.read(topics=[topic])) as entries:
        for entry in entries:
            if entry.stamp_ns < next_ns:
                continue
            next_ns = max(next_ns, entry.stamp_ns - period_ns) + period_ns
            try:
                image = content(entry.message)
            except DamagedMessage:
                continue
            if isinstance(image, Image):
                yield entry.stamp_ns, image


def _is_picture(recording: Recording, topic: str) -> bool:
    image = _first_message(recording, topic)
    return isinstance(image, Image) and image.encoding in ENCODINGS


def _frame(recording: Recording, topic: str) -> str:
    """The frame of the first message; empty if it cannot be used."""
    message = _first_message(recording, topic)
    is_picture = not isinstance(message, Image) or message.encoding in ENCODINGS
    return message.header.frame_id if message is not None and is_picture else ""


def _first_message(recording: Recording, topic: str) -> Any:
    """None if it is missing or damaged."""
    with closing(recording.read(topics=[topic])) as entries:
        entry = next(entries, None)
    try:
        return None if entry is None else content(entry.message)
    except DamagedMessage:
        return None

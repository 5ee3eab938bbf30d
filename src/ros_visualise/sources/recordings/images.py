"""Images of a recording to be processed: by default the first gray or colour ones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing

from ros_visualise.core.errors import DamagedMessage, UsageError
from ros_visualise.data import ENCODINGS, Image
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
        raise UsageError(f"{recording.path}: no topic {wanted} of images; {there}")
    found = first_image(recording, topics)
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
    with closing(recording.read(topics=[topic])) as entries:
        entry = next(entries, None)
    if entry is None:
        return False
    try:
        image = content(entry.message)
    except DamagedMessage:
        return False
    return isinstance(image, Image) and image.encoding in ENCODINGS

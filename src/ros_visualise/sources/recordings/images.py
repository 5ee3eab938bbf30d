"""Which images of a recording are to be processed, where nobody says."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing

from ros_visualise.data import ENCODINGS, Image
from ros_visualise.errors import DamagedMessage
from ros_visualise.messages.recorded import content
from ros_visualise.sources.recordings import Recording


def first_image(recording: Recording, topics: Sequence[str]) -> str | None:
    """The first of some topics of images whose first one is gray or colours, else the first.

    Depth and the like are told from these only by what the messages say. Topics without messages
    are none.
    """
    filled = [topic for topic in topics if recording.topics[topic].messages]
    if len(filled) > 1:
        for topic in filled:
            if _is_picture(recording, topic):
                return topic
    return next(iter(filled), None)


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

"""What tests of recorders that gather messages share."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

from ros_visualise.data import Header, Image
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sources.opening import open_recording

TOPICS = {name: TopicType("sensor_msgs/msg/Image") for name in ("/a", "/b")}


def image(stamp_ns: int, size: int = 3) -> Image:
    pixels = np.random.default_rng(stamp_ns).integers(0, 255, (size, size), np.uint8)
    return Image(pixels, "mono8", Header(stamp_ns, "cam"))


def read(path: Path) -> list[tuple[str, int]]:
    """(Topic, stamp) of what can be read of a file."""
    recording = open_recording(path)
    try:
        return [(entry.topic, entry.stamp_ns) for entry in recording.read()]
    finally:
        recording.close()


def read_as_it_is_now(path: Path) -> list[tuple[str, int]]:
    """Of a file that is being written, as if its writer were killed."""
    copy = path.with_name(f"now{path.suffix}")
    shutil.copyfile(path, copy)
    return read(copy)

"""Images of recordings at the times of detections, with boxes drawn on them."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import Image, Pixels
from ros_visualise.messages.recorded import content
from ros_visualise.plotting.colors import Color
from ros_visualise.sources import open_source
from ros_visualise.vision.color import demosaiced, order_of, to_bgr
from ros_visualise.vision.depth import to_8_bit

_EARLIER_NS = 2_000_000_000  # recorded before its stamp


def images_at(
    path: str, stamps_ns: Collection[int], topics: Collection[str] = ()
) -> Iterator[tuple[int, Pixels]]:
    """The images of a recording with these stamps, as BGR, in the order of the recording.

    Args:
        path: the recording.
        stamps_ns: their stamps.
        topics: of the images; none of them in the recording: all topics of images.

    Raises:
        OpenError: the recording cannot be opened.
    """
    left = set(stamps_ns)
    with closing(open_source(Path(path))) as recording:
        kinds = {name: one.type.data_class for name, one in recording.topics.items()}
        images = [name for name, kind in kinds.items() if kind is Image]
        wanted = [name for name in images if name in topics] or images
        if not left or not wanted:
            return
        begin_ns = max(recording.start_ns, min(left) - _EARLIER_NS)
        for entry in recording.read(begin_ns, topics=wanted):
            stamp_ns = entry.message.header.stamp_ns
            if stamp_ns not in left:
                continue
            left.remove(stamp_ns)
            with suppress(DamagedMessage, cv2.error):  # it was not detected in, either
                yield stamp_ns, bgr_of(content(entry.message))
            if not left:
                return


def bgr_of(image: Image) -> Pixels:
    """The pixels of an image as bgr8."""
    pixels = demosaiced(image.pixels, image.encoding)
    return to_bgr(to_8_bit(pixels), order_of(image.encoding))


def with_boxes(pixels: Pixels, labels: Collection[str], boxes: Any, color: Color) -> Pixels:
    """A copy of an image with boxes (N, 4) of left, top, width, height, and their labels."""
    drawn: Pixels = pixels.copy()
    thick = max(1, round(min(drawn.shape[:2]) / 400))
    for label, box in zip(labels, np.asarray(boxes).round().astype(int).tolist(), strict=True):
        left, top, width, height = box
        cv2.rectangle(drawn, (left, top), (left + width, top + height), color[::-1], thick)
        place = (left, max(top - 4, 12))
        cv2.putText(drawn, label, place, cv2.FONT_HERSHEY_SIMPLEX, 0.5 * thick, color[::-1], thick)
    return drawn

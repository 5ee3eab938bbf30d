"""Detections over their images, matched by stamp."""

from __future__ import annotations

import heapq
import logging
import time
from collections import deque
from collections.abc import Callable, Sequence

import cv2
import numpy as np

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import Detection, Detections, Image, Pixels
from ros_visualise.messages.recorded import Recorded, content
from ros_visualise.plotting.colors import Color, color_of
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.feed import Feed

_KEPT = 64
_WAITING_BYTES = 128 << 20  # of images whose detections may come yet
_PATIENCE_S = 1.0
_LINE_PX, _TEXT = 2, 0.45
_MOST = 200  # boxes that are painted; each takes a tenth of a millisecond, and hides others
_LETTERS = 60  # of a label
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_BLACK, _WHITE = (0, 0, 0), (255, 255, 255)

log = logging.getLogger(__name__)


class Boxes:
    """The detections in the images of a topic.

    While detections come, an image waits for its own: no box is drawn over another image.

    Args:
        topics_of: topic of images -> topics of their detections.

    Attributes:
        visible: switched on; may be changed from any thread.
    """

    def __init__(
        self,
        runtime: Runtime,
        topics_of: Callable[[str], Sequence[str]],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.visible = True
        self._runtime, self._topics_of, self._clock = runtime, topics_of, clock
        self._feeds: dict[str, Feed] = {}
        self._found: deque[Detections | Recorded] = deque(maxlen=_KEPT)  # most are never decoded
        self._reported: set[str] = set()  # faults
        self._images: deque[Image] = deque()
        self._last: Image | None = None  # whose detections were there
        self._matched_s = float("-inf")

    def refresh(self, topic: str) -> bool:
        """Take detections in the images of a topic; True if more belong to the shown one."""
        wanted = self._topics_of(topic) if self.visible else ()
        if list(self._feeds) != list(wanted):
            self.rest()
            self._feeds = {name: Feed(self._runtime, _KEPT) for name in wanted}
        is_more = False
        for name, feed in self._feeds.items():
            feed.follow(name)
            while (found := feed.take(decode=False)) is not None:
                self._found.append(found)
                is_more |= self._last is not None and is_of(found, self._last)
        return is_more

    def rest(self) -> None:
        """Unsubscribe until the next `refresh`."""
        for feed in self._feeds.values():
            feed.follow(None)
        self._feeds = {}
        self._found.clear()
        self._images.clear()
        self._last = None
        self._matched_s = float("-inf")

    def choose(self, image: Image | None) -> Image | None:
        """The image to show next, the newest with detections; None keeps the current one.

        Args:
            image: a new one, or None.
        """
        if not self._feeds:
            return image
        if image is not None:
            self._images.append(image)
            while len(self._images) > 1 and self._waiting_bytes() > _WAITING_BYTES:
                self._images.popleft()
        for place in reversed(range(len(self._images))):
            found = self._images[place]
            if self._of(found):
                for _ in range(place + 1):
                    self._images.popleft()
                self._last, self._matched_s = found, self._clock()
                return found
        return None if self._clock() - self._matched_s < _PATIENCE_S else image

    def has(self, image: Image) -> bool:
        """True if detections belong to an image."""
        return bool(self._of(image))

    def draw(self, image: Image, shown: Pixels) -> Pixels:
        """The picture ``shown`` of an image, 8-bit RGB of any size, with its detections."""
        several = [one for found in self._of(image) for one in self._decoded(found)]
        return paint(shown, several, (image.width, image.height)) if several else shown

    def _of(self, image: Image) -> list[Detections | Recorded]:
        return [found for found in self._found if is_of(found, image)]

    def _decoded(self, found: Detections | Recorded) -> Sequence[Detection]:
        try:
            several: Sequence[Detection] = content(found).detections
        except DamagedMessage as error:
            if str(error) not in self._reported:
                self._reported.add(str(error))
                log.warning("detections not drawn: %s (further occurrences suppressed)", error)
            return ()
        return several

    def _waiting_bytes(self) -> int:
        return sum(image.nbytes for image in self._images)


def is_of(found: Detections | Recorded, image: Image) -> bool:
    """True if detections belong to an image, by its stamp, and by its frame if given."""
    one, other = found.header, image.header
    is_same_frame = one.frame_id == other.frame_id or not (one.frame_id and other.frame_id)
    return one.stamp_ns == other.stamp_ns and is_same_frame


def paint(shown: Pixels, several: Sequence[Detection], size: tuple[int, int]) -> Pixels:
    """The picture of an image of that width and height, with outlines, classes and scores.

    Of very many, those with the highest scores are drawn, and the others counted.
    """
    picture: Pixels = np.ascontiguousarray(shown).copy()
    height, width = picture.shape[:2]
    scale = np.array([width / size[0], height / size[1]])
    drawn = heapq.nlargest(_MOST, several, key=lambda one: one.score)
    for one in drawn:
        corners = (one.outline_uv + 0.5) * scale - 0.5
        if len(corners) and np.isfinite(corners).all():
            corners = np.clip(np.round(corners), -(2**15), 2**15).astype(np.int32)
            color = color_of(one.class_id)
            cv2.polylines(picture, [corners], True, color, _LINE_PX, cv2.LINE_AA)
            label = one.label
            short = label if len(label) <= _LETTERS else f"{label[:_LETTERS]}..."
            _write(picture, short, corners.min(axis=0), color)
    if len(several) > len(drawn):
        _write(picture, f"and {len(several) - len(drawn)} more", np.array([0, height]), _WHITE)
    return picture


def _write(picture: Pixels, text: str, corner: Pixels, color: Color) -> None:
    """A text above a corner, inside the picture."""
    if not text:
        return
    (width, height), below = cv2.getTextSize(text, _FONT, _TEXT, 1)
    x = int(np.clip(corner[0], 0, max(picture.shape[1] - width, 0)))
    y = int(np.clip(corner[1], height + below, picture.shape[0]))
    cv2.rectangle(picture, (x, y - height - below), (x + width, y), color, cv2.FILLED)
    cv2.putText(picture, text, (x, y - below), _FONT, _TEXT, _BLACK, 1, cv2.LINE_AA)

"""One OpenCV window: a topic's images, trackbars, or both, and a caption for changes."""

from __future__ import annotations

import textwrap
import time

import cv2
import numpy as np

from ros_visualise.data import Image, Pixels
from ros_visualise.runtime.topics import Subscription
from ros_visualise.ui.boxes import Boxes
from ros_visualise.ui.preview import preview, rgb_preview
from ros_visualise.ui.screen import Box
from ros_visualise.ui.trackbars import Trackbars
from ros_visualise.vision.color import to_bgr

ROW = 25  # height of a trackbar, in pixels
STRIP = 64  # height of the caption in a window without images

_CAPTION_S = 4.0
_BACKGROUND, _INK = (239, 239, 239), (40, 40, 40)
_FONT, _FONT_SCALE, _LINE = cv2.FONT_HERSHEY_SIMPLEX, 0.45, 18
_LETTER = 8.2  # mean width of a letter of that size
_SIMILAR = 16  # pixels of width for which it is not worth scaling anew


class Pane:
    """A window, with images or a caption; ``hint`` is the caption before the first change."""

    def __init__(
        self,
        name: str,
        box: Box,
        subscription: Subscription | None = None,
        boxes: Boxes | None = None,
        hint: str = "",
    ) -> None:
        self.name = name
        self.trackbars: Trackbars | None = None
        self._box = box
        self._subscription, self._boxes = subscription, boxes
        self._image: Image | None = None
        self._caption, self._until_s = hint, 0.0
        self._drawn_width = 0
        flags = cv2.WINDOW_NORMAL | cv2.WINDOW_KEEPRATIO | cv2.WINDOW_GUI_NORMAL
        cv2.namedWindow(name, flags)

    def place(self) -> None:
        """Move it to its place, once it has its trackbars."""
        if self._subscription is None:
            self._draw()
        cv2.resizeWindow(self.name, self._box.width, self._box.height)
        cv2.moveWindow(self.name, self._box.x, self._box.y)

    @property
    def shows_images(self) -> bool:
        return self._subscription is not None

    @property
    def is_open(self) -> bool:
        """True until it is closed."""
        return bool(cv2.getWindowProperty(self.name, cv2.WND_PROP_VISIBLE) > 0)

    def update(self) -> None:
        caption = self.trackbars.update() if self.trackbars else None
        image, has_more = self._take()
        if image is not None and not image.pixels.size:
            image = None  # there is nothing to see
        if caption is not None:
            self._caption, self._until_s = caption, time.monotonic() + _CAPTION_S
        faded = self.shows_images and self._caption != "" and time.monotonic() > self._until_s
        if faded:
            self._caption = ""
        self._image = image or self._image
        if image is not None or caption is not None or faded or has_more or self._is_resized():
            self._draw()

    def close(self) -> None:
        if self._subscription is not None:
            self._subscription.close()
        if self._boxes is not None:
            self._boxes.rest()
        if self.is_open:
            cv2.destroyWindow(self.name)

    def _take(self) -> tuple[Image | None, bool]:
        """The next image to show, and True if the current one has more detections."""
        image = self._subscription.take(0) if self._subscription else None
        if self._boxes is None:
            return image, False
        has_more = self._boxes.refresh(self.name)
        return self._boxes.choose(image), has_more

    def _is_resized(self) -> bool:
        return self._image is not None and abs(self._target()[0] - self._drawn_width) > _SIMILAR

    def _target(self) -> tuple[int, int]:
        """The width and height available for the image."""
        if not self._drawn_width:
            return self._box.width, self._box.height
        _, _, width, height = cv2.getWindowImageRect(self.name)
        return max(width, 1), max(height, 1)

    def _draw(self) -> None:
        if self.shows_images and self._image is None:
            return
        if self._image is None:
            picture = np.full((STRIP, self._box.width, 3), _BACKGROUND, np.uint8)
        else:
            width, height = self._target()
            factor = min(width / self._image.width, height / self._image.height)
            longer = max(self._image.width, self._image.height)
            picture = self._with_boxes(self._image, max(round(longer * factor), 1))
            self._drawn_width = width
        cv2.imshow(self.name, _write(self._caption, picture) if self._caption else picture)

    def _with_boxes(self, image: Image, size: int) -> Pixels:
        """The image as it is shown, gray or BGR, its longer side of that size."""
        if self._boxes is None:
            return preview(image, size)
        picture = self._boxes.draw(image, rgb_preview(image, size))
        return cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)


def _write(text: str, picture: Pixels) -> Pixels:
    """A copy of a picture with text along its lower edge."""
    picture = to_bgr(picture, "BGR").copy()
    height, width = picture.shape[:2]
    columns = max(int(width / _LETTER), 20)
    lines = [part for line in text.splitlines() for part in textwrap.wrap(line, columns)][:3]
    top = max(height - _LINE * len(lines) - 8, 0)
    picture[top:] = _BACKGROUND
    for number, line in enumerate(lines, 1):
        place = (6, top + _LINE * number)
        cv2.putText(picture, line, place, _FONT, _FONT_SCALE, _INK, 1, cv2.LINE_AA)
    return picture

"""The images on the page, made on a thread of their own and only while somebody looks."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from html import escape

import cv2
import numpy as np
import viser

from ros_visualise.data import Image, Pixels
from ros_visualise.runtime.base import Runtime, Subscription
from ros_visualise.ui.page.overlay import Overlay
from ros_visualise.ui.preview import preview

SIZE = 720
"""Pixels of an image's longer side on the page, to start with."""
_PERIOD_S = 1 / 30
_REST = 2.0
_REST_IN_HASTE = 8.0
_JPEG_QUALITY = 85


class Picture:
    """One image element: shows the newest image of a topic.

    Args:
        rows: how many elements stand above it in its window.
        overlay: what is drawn over it.
    """

    def __init__(
        self, gui: viser.GuiApi, runtime: Runtime, topic: str, rows: int, overlay: Overlay
    ) -> None:
        self.topic = topic
        """What it shows; may be changed from any thread."""
        self.visible = True
        """Whether it is on the page at all; may be changed from any thread."""
        self._runtime, self._rows, self._overlay = runtime, rows, overlay
        self._followed: str | None = None
        self._subscription: Subscription | None = None
        self._image: Image | None = None
        self._size = 0
        blank = np.zeros((9, 16, 3), np.uint8)
        self._element = gui.add_image(blank, format="jpeg", jpeg_quality=_JPEG_QUALITY)
        self._caption = gui.add_html(self._describe())

    def refresh(self, size: int, previews: dict[int, Pixels]) -> None:
        """Show the newest image, if there is a new one, or the last one in a new size.

        Args:
            size: of the longer side in pixels.
            previews: by the id of their image, those that this round made already.
        """
        self._follow(self.topic if self.visible else None)
        image = self._subscription.take(0) if self._subscription else None
        over = self._overlay.refresh() if self.visible else False
        if self._image is None and image is None:
            return
        if image is None and size == self._size and not over:
            return
        self._image, self._size = image or self._image, size
        assert self._image is not None
        if id(self._image) not in previews:
            previews[id(self._image)] = _to_rgb(preview(self._image, size))
        shown = previews[id(self._image)]
        self._element.image = self._overlay.draw(self._image, self.topic, shown)
        self._caption.content = self._describe()

    def _describe(self) -> str:
        image = self._image
        size = "no image yet" if image is None else f"{image.width} × {image.height}"
        encoding = "" if image is None else image.encoding
        return (
            f'<div class="rv-caption rv-rows-{self._rows}">'
            f"{escape(self.topic)}<span>{size} {escape(encoding)}</span></div>"
        )

    def rest(self) -> None:
        """Ask for nothing until the next `refresh`."""
        self._follow(None)
        self._overlay.rest()

    def _follow(self, topic: str | None) -> None:
        if topic == self._followed:
            return
        if self._subscription is not None:
            self._subscription.close()
        self._subscription = None if topic is None else self._runtime.subscribe(topic)
        self._followed = topic


class ImageThread:
    """Keeps pictures fresh, 30 times a second where there is time for it.

    Args:
        pictures: the pictures.
        is_watched: whether anybody looks at the page.
        in_haste: whether the graph runs as fast as it goes, and time taken here slows it.
    """

    def __init__(
        self,
        pictures: Sequence[Picture],
        is_watched: Callable[[], bool],
        in_haste: Callable[[], bool],
    ) -> None:
        self.size = SIZE
        self._pictures, self._is_watched, self._in_haste = pictures, is_watched, in_haste
        self._at_work = threading.Lock()
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="images", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def show(self, pictures: Sequence[Picture]) -> None:
        """Keep these pictures fresh from now on; the others ask for nothing any more."""
        with self._at_work:
            for picture in self._pictures:
                if picture not in pictures:
                    picture.rest()
            self._pictures = pictures

    def close(self, timeout_s: float) -> None:
        """End after the round that is under way."""
        self._closed.set()
        if self._thread.ident is not None:
            self._thread.join(timeout_s)

    def _run(self) -> None:
        pause_s = 0.0
        while not self._closed.wait(pause_s):
            start_s, cpu_s = time.perf_counter(), time.thread_time()
            with self._at_work:
                self._refresh()
            spent_s = time.perf_counter() - start_s
            pause_s = max(_PERIOD_S - spent_s, self._rest * (time.thread_time() - cpu_s))
        for picture in self._pictures:
            picture.rest()

    @property
    def _rest(self) -> float:
        """How long to pause for each second of computing: the nodes come first."""
        return _REST_IN_HASTE if self._in_haste() else _REST

    def _refresh(self) -> None:
        watched = self._is_watched()
        previews: dict[int, Pixels] = {}
        for picture in self._pictures:
            picture.refresh(self.size, previews) if watched else picture.rest()


def _to_rgb(pixels: Pixels) -> Pixels:
    return cv2.cvtColor(pixels, cv2.COLOR_GRAY2RGB if pixels.ndim == 2 else cv2.COLOR_BGR2RGB)

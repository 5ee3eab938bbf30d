"""Images on the page, drawn on a thread of their own, only while a browser shows them."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from html import escape

import viser

from ros_visualise.data import Image, Pixels
from ros_visualise.lessons.magnifier import pixel_at
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.boxes import Boxes
from ros_visualise.ui.feed import Feed
from ros_visualise.ui.live.images import ImageChannel
from ros_visualise.ui.look import link
from ros_visualise.ui.page.overlay import Overlay
from ros_visualise.ui.periodic import PeriodicThread
from ros_visualise.ui.preview import rgb_preview

log = logging.getLogger(__name__)

SIZE = 720
"""Initial limit of an image's longer side on the page, pixels."""
_PERIOD_S = 1 / 30


class Picture:
    """One image element: shows the newest image of a topic.

    ``topic`` and ``visible`` may be changed from any thread.

    Args:
        channel: sends it to browsers, under ``name``.
        rows: number of elements above it in its window.
        overlay: points that are drawn over it.
        boxes: detections that are drawn over it.
        picks: the node for which a click chooses a pixel; empty: a click inspects the image.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        runtime: Runtime,
        channel: ImageChannel,
        topic: str,
        rows: int,
        overlay: Overlay,
        boxes: Boxes,
        picks: str = "",
    ) -> None:
        self.topic = topic
        self.visible = True
        self._channel = channel
        self._rows, self._overlay, self._boxes, self._picks = rows, overlay, boxes, picks
        self._feed = Feed(runtime)
        self._image: Image | None = None
        self._size = 0
        gui.add_html(f'<div class="rv-image" data-image="{escape(channel.name)}"></div>')
        self._caption = gui.add_html(self._describe())

    def refresh(self, limit: int, previews: dict[tuple[int, int], Pixels]) -> None:
        """Show the newest image, or the last one in a new size.

        Args:
            limit: of the longer side in pixels.
            previews: id of an image and a size -> its preview, of this round.
        """
        size = min(self._channel.size, limit)
        if not (self.visible and size):
            self.rest()
            return
        self._feed.follow(self.topic)
        if not self._channel.is_ready:  # newer images replace the one that waits
            return
        is_more = self._boxes.refresh(self.topic)
        image = self._boxes.choose(self._feed.take())
        is_other = self._overlay.refresh() or is_more or size != self._size
        shown = image or self._image
        if shown is not None and (image is not None or is_other):
            self._image, self._size = shown, size
            self._show(shown, previews)

    @property
    def aspect(self) -> float | None:
        """Width over height of the image; None before the first one."""
        image = self._image
        return image.width / image.height if image is not None and image.height else None

    def pixel_at(self, across: float, down: float) -> tuple[int, int] | None:
        """(x, y) of the pixel at shares of the image's width and height."""
        return None if self._image is None else pixel_at(self._image, across, down)

    def rest(self) -> None:
        """Unsubscribe until the next `refresh`."""
        self._feed.follow(None)
        self._overlay.rest()
        self._boxes.rest()

    def _show(self, image: Image, previews: dict[tuple[int, int], Pixels]) -> None:
        caption = self._describe()
        if caption != self._caption.content:  # a link that is made anew would miss a click
            self._caption.content = caption
        if not image.pixels.size:
            return
        key = id(image), self._size
        if key not in previews:
            previews[key] = rgb_preview(image, self._size)
        shown = self._overlay.draw(image, self.topic, previews[key])
        self._channel.show(self._boxes.draw(image, shown))

    def _describe(self) -> str:
        image = self._image
        size = "No image yet" if image is None else f"{image.width} × {image.height}"
        encoding = "" if image is None else image.encoding
        return (
            f'<div class="rv-caption rv-rows-{self._rows}">{self._link()}'
            f"{escape(self.topic)}<span>{size} {escape(encoding)}</span></div>"
        )

    def _link(self) -> str:
        """The link over the picture: a click inspects the image, or chooses a pixel."""
        image = self._image
        shape = "16 / 9" if image is None else f"{image.width} / {image.height}"
        look = f'href="{escape(link("image", topic=self.topic))}" target="_blank"'
        over = f'class="rv-whole" style="aspect-ratio: {shape}"'
        if self._picks:
            pick = f'{over} data-pick="{escape(self._picks)}" title="Choose a pixel"'
            return f"<i {pick}></i><a {look}>Inspect</a> "
        return f'<a {over} {look} title="Inspect"></a>'


class ImageThread(PeriodicThread):
    """Refreshes pictures up to 30 times a second, while ``is_watched``.

    ``unthrottled`` is True while the graph runs as fast as possible, and work here slows it.
    """

    def __init__(
        self,
        pictures: Sequence[Picture],
        is_watched: Callable[[], bool],
        unthrottled: Callable[[], bool],
    ) -> None:
        super().__init__("images", self._do_round, self._rest, _PERIOD_S, unthrottled)
        self.size = SIZE
        self._pictures, self._is_watched = pictures, is_watched
        self._reported: set[str] = set()  # topics with a reported problem

    def show(self, pictures: Sequence[Picture]) -> None:
        """Refresh these pictures and no others."""
        with self.at_work:
            for picture in self._pictures:
                if picture not in pictures:
                    picture.rest()
            self._pictures = pictures

    def _rest(self) -> None:
        for picture in self._pictures:
            picture.rest()

    def _do_round(self) -> None:
        if not self._is_watched():
            self._rest()
            return
        previews: dict[tuple[int, int], Pixels] = {}
        for picture in self._pictures:
            try:
                picture.refresh(self.size, previews)
            except Exception as error:  # a damaged image does not stop the next one
                self._report(picture.topic, error)

    def _report(self, topic: str, error: Exception) -> None:
        if topic not in self._reported:
            self._reported.add(topic)
            log.warning(
                "%s not shown: %s (further occurrences suppressed)", topic, error, exc_info=error
            )

"""OpenCV windows with trackbars: one window for each node's images."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from functools import partial

import cv2

from ros_visualise.graph import Member
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.boxes import Boxes
from ros_visualise.ui.pane import ROW, STRIP, Pane
from ros_visualise.ui.screen import (
    TITLE,
    Box,
    check_windows,
    parse_place,
    part_of,
    provide_font,
    screen_size,
    tile,
)
from ros_visualise.ui.shown import detections_of, first_shown
from ros_visualise.ui.trackbars import Scale, Trackbars, scales_of

_BESIDE = 10  # a node with more trackbars than this has them in a window of their own
_WHOLE = (1, 1)
_COLUMN = 400  # width of such a window, in pixels
_TICK_MS = 15
_HINT = "Q or Esc: quit"
_PLAYING_HINT = f"space: pause   arrows, comma, full stop: step\n{_HINT}"

_KEYS = {
    **{ord(" "): "pause", ord(","): "back", ord("."): "step"},
    **{ord("q"): "quit", ord("Q"): "quit", 27: "quit"},
    **{0xFF51: "back", 0xFF53: "step"},  # arrows as X11 names them,
    **{0x250000: "back", 0x270000: "step"},  # as Windows does,
    **{63234: "back", 63235: "step"},  # and as macOS does
}


class Windows:
    """Images of all nodes, with the nodes' parameters as trackbars.

    Args:
        place: "2/4" uses the second of four equal parts of the screen, for several programs with
            windows; empty uses all of it.

    Raises:
        OpenError: this OpenCV lacks windows, or the display is missing.
        UsageError: the place has another form.
    """

    stays = True

    def __init__(self, place: str = "") -> None:
        self._part = parse_place(place)
        check_windows()
        self._font = provide_font()
        self._panes: list[Pane] = []
        self._closed = False
        self._actions: dict[str, Callable[[], None]] = {"quit": self._quit}

    def open(self, runtime: Runtime) -> None:
        """Show this graph from now on."""
        if (playback := runtime.playback) is not None:
            self._actions |= {
                "pause": playback.toggle,
                "step": playback.step,
                "back": lambda: playback.step(-1),
            }
        width, height = screen_size()
        images = list(_image_topics(runtime))
        controls = list(_control_windows(runtime, height - TITLE))
        columns = max(len(controls), self._part != _WHOLE)  # other programs' may be there too
        taken = min(_COLUMN * columns, width // 2)
        self._open_images(runtime, images, part_of(Box(0, 0, width - taken, height), *self._part))
        for number, (node, title, scales) in enumerate(controls):
            x = width - taken + number * taken // len(controls)
            box = Box(x, 0, _COLUMN - 6, STRIP + ROW * len(scales))
            pane = Pane(title, box, hint=_PLAYING_HINT if runtime.playback else _HINT)
            pane.trackbars = Trackbars(title, runtime.parameters[node.name], scales)
            self._panes.append(pane)
        for pane in self._panes:
            pane.place()

    awaited = False

    @property
    def closed(self) -> bool:
        """True once a person has quit, or closed the last window with images."""
        return self._closed

    def spin(self, timeout_s: float) -> None:
        """Show new images, and handle keys and trackbars."""
        end_s = time.monotonic() + timeout_s
        while not self._closed and (left_s := end_s - time.monotonic()) > 0:
            self._forget_closed()
            for pane in self._panes:
                pane.update()
            self._press(cv2.waitKeyEx(min(_TICK_MS, math.ceil(left_s * 1000))))

    def close(self) -> None:
        self._closed = True
        for pane in self._panes:
            pane.close()
        self._panes.clear()
        if self._font is not None:
            self._font.cleanup()

    def _open_images(self, runtime: Runtime, images: list[tuple[Member, str]], area: Box) -> None:
        scales = [_beside(runtime, node) for node, _ in images]
        boxes = tile(area, [ROW * len(some) for some in scales])
        for (node, topic), some, box in zip(images, scales, boxes, strict=True):
            has_boxes = detections_of(runtime.graph, topic)
            found = Boxes(runtime, partial(detections_of, runtime.graph)) if has_boxes else None
            pane = Pane(topic, box, runtime.subscribe(topic), found)
            if some:
                pane.trackbars = Trackbars(topic, runtime.parameters[node.name], some)
            self._panes.append(pane)

    def _forget_closed(self) -> None:
        for pane in [pane for pane in self._panes if not pane.is_open]:
            pane.close()
            self._panes.remove(pane)
        if not any(pane.shows_images for pane in self._panes):
            self._closed = True

    def _press(self, key: int) -> None:
        name = _KEYS.get(key) or _KEYS.get(key & 0xFFFF)  # X11 puts Num Lock and so on above
        if name in self._actions:
            self._actions[name]()

    def _quit(self) -> None:
        self._closed = True


def _image_topics(runtime: Runtime) -> Iterator[tuple[Member, str]]:
    for node in runtime.graph.members:
        topic = first_shown(runtime.graph, node)
        if topic is not None:
            yield node, topic


def _beside(runtime: Runtime, node: Member) -> list[Scale]:
    """The trackbars that go below a node's image."""
    scales = scales_of(runtime.parameters[node.name].current)
    return scales if len(scales) <= _BESIDE else []


def _control_windows(runtime: Runtime, height: int) -> Iterator[tuple[Member, str, list[Scale]]]:
    """The windows of trackbars alone: for nodes with many, or without images."""
    room = max((height - STRIP) // ROW, 1)
    shown = {node.name for node, _ in _image_topics(runtime)}
    for node in runtime.graph.members:
        scales = scales_of(runtime.parameters[node.name].current)
        if node.name in shown and len(scales) <= _BESIDE:
            continue
        parts = math.ceil(len(scales) / room)
        size = math.ceil(len(scales) / max(parts, 1))
        for part in range(parts):
            title = node.name + (f" {part + 1}/{parts}" if parts > 1 else "")
            yield node, title, scales[part * size : (part + 1) * size]

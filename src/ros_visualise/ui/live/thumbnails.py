"""Small images of a recording or film, for times that a person points at on the timeline."""

from __future__ import annotations

import threading
from contextlib import closing
from typing import Any

import cv2

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.data import Image
from ros_visualise.messages.recorded import content
from ros_visualise.runtime.base import Runtime
from ros_visualise.sources.recordings import Recording
from ros_visualise.ui.live.played import PlaybackLine, playback_line
from ros_visualise.ui.preview import preview

_SIDE, _QUALITY = 160, 70
_PARTS = 200
"""Thumbnails that a whole recording has at most."""
_NS = 1_000_000_000


class Thumbnails:
    """Makes thumbnails when they are asked for, one at a time, and keeps them as JPEG.

    Those of a film are its key images; those of a recording the first image after a time.
    """

    def __init__(self, runtime: Runtime) -> None:
        self._runtime = runtime
        self._line = playback_line(runtime.graph, runtime.playback)
        self._made: dict[int, bytes] = {}
        self._recording: Recording | None = None
        self._params: Any = None
        self._making = threading.Lock()
        self._closed = False

    def at(self, time_s: float) -> bytes:
        """The JPEG for a time from the start; empty without an image."""
        duration_s = 0.0 if self._line is None else self._line.playback.state.duration_s or 0.0
        if self._line is None or not duration_s:
            return b""
        part = min(max(int(time_s / duration_s * _PARTS), 0), _PARTS - 1)
        with self._making:
            self._follow()
            if part not in self._made and not self._closed:
                place_ns = round((part + 0.5) * duration_s / _PARTS * _NS)
                self._made[part] = _small(self._find(self._line, place_ns))
            return self._made.get(part, b"")

    def close(self) -> None:
        """Close the recording."""
        self._closed = True
        with self._making:
            if self._recording is not None:
                self._recording.close()

    def _follow(self) -> None:
        """Begin anew where sources that are played together were moved."""
        source = self._runtime.graph.source
        params = None if source is None else self._runtime.parameters[source.name].current
        if params is not self._params:
            self._params, self._made = params, {}
            if self._recording is not None:
                self._recording.close()
                self._recording = None

    def _find(self, line: PlaybackLine, place_ns: int) -> Image | None:
        try:
            return self._read(line, place_ns)
        except (RosVisualiseError, ValueError, OSError):
            return None

    def _read(self, line: PlaybackLine, place_ns: int) -> Image | None:
        if line.playback.key_image is not None:
            found = line.playback.key_image(place_ns)
            return None if found is None else found[1]
        topic, source = self._topic, self._runtime.graph.source
        if topic is None or source is None or source.type.recording is None:
            return None
        self._recording = self._recording or source.type.recording(self._params)
        stamp_ns = line.time_ns(place_ns)
        with closing(self._recording.read(stamp_ns, None, [topic])) as entries:
            entry = next(entries, None)
        image = None if entry is None else content(entry.message)
        return image if isinstance(image, Image) else None

    @property
    def _topic(self) -> str | None:
        """The topic of images that goes through the nodes, else the first one."""
        source, playback = self._runtime.graph.source, self._runtime.playback
        if source is None or playback is None:
            return None
        topics = [name for name, kind in source.type.outputs.items() if kind is Image]
        chosen = playback.step_topic
        return chosen if chosen in topics else next(iter(topics), None)


def _small(image: Image | None) -> bytes:
    if image is None or not image.pixels.size:
        return b""
    how = [cv2.IMWRITE_JPEG_QUALITY, _QUALITY]
    return cv2.imencode(".jpg", preview(image, _SIDE), how)[1].tobytes()

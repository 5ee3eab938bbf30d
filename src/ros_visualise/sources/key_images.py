"""The key images of a video, which are decoded by themselves: previews while one seeks."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

from av.container import InputContainer
from av.error import FFmpegError
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from ros_visualise.core.errors import OpenError
from ros_visualise.data import Image
from ros_visualise.sources.demux import open_container, video_stream
from ros_visualise.sources.video_pixels import FrameConverter, Size

_LONGEST = 1280  # pixels
_MOST_PACKETS = 64


class KeyImages:
    """Finds key images in a file that is opened once more; safe to call from any thread.

    Args:
        origin: stamp of the first frame, in ticks of the stream.
        size: width and height of the video; larger images than previews need are scaled.
    """

    def __init__(self, path: Path, origin: int, size: Size) -> None:
        self._path, self._origin = path, origin
        shrink = min(1.0, _LONGEST / max(size))
        self._converter = FrameConverter(
            (round(size[0] * shrink) or 1, round(size[1] * shrink) or 1)
        )
        self._opened: tuple[InputContainer, VideoStream] | None = None
        self._lock = threading.Lock()

    def at(self, time_ns: int) -> tuple[int, Image] | None:
        """(Time, image) of the key image at or before a time; None where it cannot be decoded."""
        with self._lock:
            try:
                return self._find(time_ns)
            except (OpenError, FFmpegError, OSError):
                return None

    def _find(self, time_ns: int) -> tuple[int, Image] | None:
        container, stream = self._opened = self._opened or self._open()
        tick_ns = (stream.time_base or 0) * 10**9
        if not tick_ns:
            return None
        container.seek(self._origin + int(time_ns / tick_ns), stream=stream)
        frame = next(_decoded(container, stream), None)
        if frame is None or frame.pts is None:
            return None
        return round((frame.pts - self._origin) * tick_ns), self._converter.image(frame)

    def _open(self) -> tuple[InputContainer, VideoStream]:
        container = open_container(self._path)
        stream = video_stream(container, self._path)
        stream.thread_type = "SLICE"  # the threads of frames give the first one late
        return container, stream


def _decoded(container: InputContainer, stream: VideoStream) -> Iterator[VideoFrame]:
    """The frames of the first key packet."""
    for count, packet in enumerate(container.demux(stream)):
        if packet.is_keyframe and packet.size:
            yield from stream.decode(packet)
            yield from stream.decode(None)
            return
        if count > _MOST_PACKETS:
            return

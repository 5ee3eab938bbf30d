"""Images of a video that are found at once, as previews while one seeks: mostly its key images."""

from __future__ import annotations

import itertools
import threading
import time
from collections import deque
from pathlib import Path

from av.container import InputContainer
from av.error import FFmpegError
from av.packet import Packet
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from ros_visualise.core.errors import OpenError
from ros_visualise.data import Image
from ros_visualise.sources.demux import open_container, video_stream
from ros_visualise.sources.video_pixels import FrameConverter, Size

_LONGEST, _LONGEST_PASSED = 1280, 640  # pixels
_MOST_PACKETS = 64
_KEPT, _KEPT_PASSED = 16, 32  # images, of some 3 and 0.7 MB each
_PASSED_S = 0.15


class KeyImages:
    """Finds key images in a file that is opened once more; safe to call from any thread.

    Some of the images that are decoded on the way to another one are kept, too.

    Args:
        origin: stamp of the first frame, in ticks of the stream.
        size: width and height of the video; larger images than previews need are scaled.
    """

    def __init__(self, path: Path, origin: int, size: Size) -> None:
        self._path, self._origin = path, origin
        self._converter = FrameConverter(_fitted(size, _LONGEST))
        self._passed_converter = FrameConverter(_fitted(size, _LONGEST_PASSED))
        self._passed: deque[tuple[int, Image]] = deque(maxlen=_KEPT_PASSED)
        self._next_s = 0.0
        self._opened: tuple[InputContainer, VideoStream] | None = None
        self._kept: dict[int, Image] = {}  # by the stamps of their packets
        self._lock = threading.Lock()

    def at(self, time_ns: int) -> tuple[int, Image] | None:
        """(Time, image) of what is nearest of the key image at or before a time and those kept.

        None where it cannot be decoded.
        """
        near = list(self._passed)
        with self._lock:
            try:
                key = self._find(time_ns)
            except (OpenError, FFmpegError, OSError):
                key = None
        if key is not None:
            near.append(key)
        return min(near, key=lambda one: abs(one[0] - time_ns), default=None)

    def keep(self, time_ns: int, frame: VideoFrame) -> None:
        """Keep a frame that is decoded on the way to another one; of many, a few a second."""
        now_s = time.monotonic()
        if now_s >= self._next_s:
            self._next_s = now_s + _PASSED_S
            self._passed.append((time_ns, self._passed_converter.image(frame)))

    def _find(self, time_ns: int) -> tuple[int, Image] | None:
        container, stream = self._opened = self._opened or self._open()
        tick_ns = (stream.time_base or 0) * 10**9
        if not tick_ns:
            return None
        container.seek(self._origin + int(time_ns / tick_ns), stream=stream)
        packet = _key_packet(container, stream)
        if packet is None or packet.pts is None:
            return None
        found = self._kept.pop(packet.pts, None)
        if found is None:
            frames = [*stream.decode(packet), *stream.decode(None)]
            if not frames:
                return None
            found = self._converter.image(frames[0])
        self._kept[packet.pts] = found  # the newest at the end
        if len(self._kept) > _KEPT:
            del self._kept[next(iter(self._kept))]
        return round((packet.pts - self._origin) * tick_ns), found

    def _open(self) -> tuple[InputContainer, VideoStream]:
        container = open_container(self._path)
        stream = video_stream(container, self._path)
        stream.thread_type = "SLICE"  # the threads of frames give the first one late
        return container, stream


def _fitted(size: Size, longest: int) -> Size:
    """The size of a video's previews, no side longer than that."""
    shrink = min(1.0, longest / max(size))
    return round(size[0] * shrink) or 1, round(size[1] * shrink) or 1


def _key_packet(container: InputContainer, stream: VideoStream) -> Packet[VideoStream] | None:
    """The first key packet from where the file was sought to."""
    packets = itertools.islice(container.demux(stream), _MOST_PACKETS)
    return next((packet for packet in packets if packet.is_keyframe and packet.size), None)

"""Video files, by PyAV: real presentation times, rotation applied, decoded with several threads."""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from av.container import InputContainer
from av.error import FFmpegError
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from ros_visualise.data import Image
from ros_visualise.errors import OpenError
from ros_visualise.sources.convert import Converter, Size, upright_size
from ros_visualise.sources.demux import Decoder, open_container, video_stream

log = logging.getLogger(__name__)

_DEFAULT_FPS = 25.0
_JUMP_BACK_NS = 1_000_000_000  # further than this, the clock of the file was set anew
_SHORT_NS = 500_000_000  # a file that ends this much before its promised end was cut


@dataclass(frozen=True)
class VideoInfo:
    """What a video file says of itself; width and height as they are shown."""

    width: int
    height: int
    fps: float
    codec: str
    duration_ns: int | None
    frames: int | None
    only_video: bool


class Video:
    """A video file that can be read from any time.

    Args:
        path: the file, whatever its name.
        size: (width, height) to scale every frame to while decoding.

    Raises:
        OpenError: it cannot be played; the message says why and what to do.
    """

    def __init__(self, path: str | os.PathLike[str], size: Size | None = None) -> None:
        self._path = Path(path)
        self._converter = Converter(size)
        self._closed = self._warned = False
        with closing(open_container(self._path)) as container:
            stream = video_stream(container, self._path)
            first = _first_frame(container, stream, self._path)
            self._origin = first.pts
            self.info = _info(container, stream, first, size)

    @property
    def duration_ns(self) -> int | None:
        """The length that the header promises."""
        return self.info.duration_ns

    def read(self, start_ns: int = 0) -> Generator[tuple[int, Image], None, None]:
        """(Time since the first frame, image), from the frame shown at ``start_ns`` on."""
        shown: tuple[int, VideoFrame] | None = None
        with closing(self._frames_from(start_ns)) as frames:
            for time_ns, frame in frames:
                if time_ns > start_ns and shown is not None:
                    yield shown[0], self._converter.image(shown[1])
                    shown = None
                if time_ns > start_ns:
                    yield time_ns, self._converter.image(frame)
                else:
                    shown = time_ns, frame
        if shown is not None:
            yield shown[0], self._converter.image(shown[1])

    def close(self) -> None:
        """End what is being read."""
        self._closed = True

    def _frames_from(self, start_ns: int) -> Generator[tuple[int, VideoFrame], None, None]:
        """Timed frames from the one shown at that time or from one before it."""
        if start_ns > 0:
            with closing(self._frames(start_ns)) as frames:
                first = next(frames, None)
                if first is not None and first[0] <= start_ns:
                    yield first
                    yield from frames
                    return
        yield from self._frames(0)

    def _frames(self, seek_ns: int) -> Generator[tuple[int, VideoFrame], None, None]:
        """Timed frames from the last keyframe before a time, as far as the file can be sought."""
        with closing(open_container(self._path)) as container:
            stream = video_stream(container, self._path)
            if seek_ns and not self._seek(container, stream, seek_ns):
                return
            decoder = Decoder(container, stream)
            times = _Times(stream.time_base, self._origin, self.info.fps)
            for frame in decoder.frames():
                if self._closed or (seek_ns and frame.pts is None):
                    return
                yield times.of(frame), frame
            self._check_end(decoder, times.end_ns, from_start=seek_ns == 0)

    def _seek(self, container: InputContainer, stream: VideoStream, time_ns: int) -> bool:
        if self._origin is None or stream.time_base is None:
            return False
        try:
            container.seek(
                self._origin + math.floor(time_ns / (stream.time_base * 10**9)), stream=stream
            )
        except FFmpegError:
            return False
        return True

    def _check_end(self, decoder: Decoder, end_ns: int, from_start: bool) -> None:
        """Say once what was missing or damaged."""
        missing = (self.info.frames or 0) - decoder.packets if from_start else 0
        cut = (self.info.duration_ns or 0) - end_ns > _SHORT_NS and self.info.only_video
        faults = []
        if decoder.damaged:
            faults.append(f"{decoder.damaged} damaged packets were skipped")
        if missing > 0 or cut or decoder.broken:
            promised = f"{self.info.frames} frames" if missing > 0 else "more"
            faults.append(f"it ends after {end_ns / 1e9:.2f} s although it promises {promised}")
        if faults and not self._warned:
            self._warned = True
            log.warning("%s: %s", self._path, "; ".join(faults))


class _Times:
    """The presentation times of frames since the first, always increasing."""

    def __init__(self, time_base: Fraction | None, origin: int | None, fps: float) -> None:
        self._time_base, self._origin = time_base, origin
        self._period_ns = round(1e9 / fps)
        self._last_ns: int | None = None
        self._shift_ns = 0

    @property
    def end_ns(self) -> int:
        """Where the last frame's period ends."""
        return 0 if self._last_ns is None else self._last_ns + self._period_ns

    def of(self, frame: VideoFrame) -> int:
        """The time of the next frame; where the file has none, the frame rate gives it."""
        time_ns = self.end_ns
        if frame.pts is not None and self._origin is not None and self._time_base is not None:
            time_ns = round((frame.pts - self._origin) * self._time_base * 10**9) + self._shift_ns
        if self._last_ns is not None and time_ns <= self._last_ns:
            if self._last_ns - time_ns > _JUMP_BACK_NS:
                self._shift_ns += self.end_ns - time_ns
            time_ns = max(time_ns, self._last_ns + self._period_ns // 4)
        self._last_ns = time_ns
        return time_ns


def _first_frame(container: InputContainer, stream: VideoStream, path: Path) -> VideoFrame:
    for frame in Decoder(container, stream).frames():
        return frame
    raise OpenError(f"{path}: no frame of its video can be decoded; copy or convert it again")


def _info(
    container: InputContainer, stream: VideoStream, first: VideoFrame, size: Size | None
) -> VideoInfo:
    width, height = size or upright_size(first)
    duration_ns = None
    if stream.duration and stream.time_base:
        duration_ns = round(stream.duration * stream.time_base * 10**9)
    elif container.duration:
        duration_ns = container.duration * 1000
    fps = float(stream.average_rate or stream.guessed_rate or _DEFAULT_FPS)
    only_video = not container.streams.audio
    codec = stream.codec_context.name
    return VideoInfo(width, height, fps, codec, duration_ns, stream.frames or None, only_video)

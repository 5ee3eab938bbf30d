"""Video files, by PyAV: real presentation times, rotation applied, decoded with several threads."""

from __future__ import annotations

import itertools
import math
import os
from collections import deque
from collections.abc import Callable, Collection, Generator, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from av.container import InputContainer
from av.error import FFmpegError
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from ros_visualise.core.errors import OpenError
from ros_visualise.data import Header, Image
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sources.container_lengths import promised_bytes
from ros_visualise.sources.demux import Decoder, open_container, video_stream
from ros_visualise.sources.key_images import KeyImages
from ros_visualise.sources.recordings import Entry, Extra, Loss, TopicInfo
from ros_visualise.sources.video_pixels import FrameConverter, Size, upright_size

_DEFAULT_FPS = 25.0
_JUMP_BACK_NS = 1_000_000_000  # further than this, the clock of the file was set anew
_SEEK_EARLIER_NS = (0, 2_000_000_000, 10_000_000_000)
_AHEAD_NS, _AHEAD_OF_KEY_NS = 2_000_000_000, 30_000_000_000
"""Further than this, it is sought even where no key frames are known, or none lies between."""
_NEEDED = 2  # frames before the one that is sought, none of which are omitted
_SILENT = 0.1  # of the packets, at most: some codecs have a few that show nothing
_MOST_SILENT = 2  # where there are few
_SHORT_NS = 500_000_000  # a file that ends this much before its promised end was cut
_TOPIC = "/image_raw"
_FRAME = "camera_optical"


@dataclass(frozen=True)
class VideoInfo:
    """Header of a video file; width and height as they are shown.

    ``promised_ns`` is the length unless it is that of a longer sound.
    """

    width: int
    height: int
    fps: float
    codec: str
    duration_ns: int | None
    promised_ns: int | None
    frames: int | None


class Video:
    """A video file that can be read from any time.

    Args:
        path: the file, whatever its name.
        size: (width, height) to scale every frame to while decoding.

    Attributes:
        faults: what was missing or damaged, known at the end.
        is_outdated: returns True when the present reading may end early.

    Raises:
        OpenError: it cannot be played; the message says why and what to do.
    """

    def __init__(self, path: str | os.PathLike[str], size: Size | None = None) -> None:
        self._path = Path(path)
        self._converter = FrameConverter(size)
        self.faults: list[str] = []
        self.is_outdated: Callable[[], bool] = lambda: False
        self._closed = False
        self._target_ns = 0
        self._decoder: Decoder
        self._last: deque[tuple[int, VideoFrame]] = deque(maxlen=2)  # that were read
        self._reading: Iterator[tuple[int, VideoFrame]] = iter(())
        self._open()
        first = next(Decoder(self._container, self._stream).frames(), None)
        if first is None:
            raise OpenError(f"{path}: no video frame can be decoded; convert the file again")
        self._origin = first.pts
        self.info = _info(self._container, self._stream, first, size)
        self._keys: KeyImages | None = None

    @property
    def duration_ns(self) -> int | None:
        """The length that the header promises."""
        return self.info.duration_ns

    def read(self, start_ns: int = 0) -> Generator[tuple[int, Image], None, None]:
        """(Time since the first frame, image), from the frame shown at ``start_ns`` on.

        Reading again ends what was read before.
        """
        shown: tuple[int, VideoFrame] | None = None
        for timed in self._frames_around(start_ns):
            if not self._last or timed[0] > self._last[-1][0]:  # it is not read again
                self._last.append(timed)
            if self._closed or self.is_outdated():
                return
            is_later = timed[0] > start_ns
            if shown is not None and is_later:
                yield shown[0], self._converter.image(shown[1])
            shown = timed
            if is_later or self._is_shown_at(timed[1], start_ns):
                shown = None
                if not is_later:  # some before it may have been omitted
                    while self._last[0][0] < timed[0]:
                        self._last.popleft()
                yield timed[0], self._converter.image(timed[1])
        if shown is not None:
            yield shown[0], self._converter.image(shown[1])

    def _is_shown_at(self, frame: VideoFrame, time_ns: int) -> bool:
        """True if it is known, before the next one is decoded, that a frame is shown at a time."""
        ticks = self._ticks(time_ns)
        if ticks is None or frame.pts is None or frame.pts > ticks:
            return False
        return self._decoder.is_last_until(frame.pts, ticks)

    @property
    def format(self) -> str:
        """Name of the file's format, FFmpeg's short one."""
        return str(self._container.format.name).partition(",")[0]

    @property
    def key_images(self) -> KeyImages | None:
        """Its key images, and some on the way to others; None if its frames have no times."""
        if self._keys is None and self._origin is not None:
            size = self.info.width, self.info.height
            self._keys = KeyImages(self._path, self._origin, size)
        return self._keys

    def count(self) -> int:
        """The number of its images, counted without decoding them."""
        self._open()
        decoder = Decoder(self._container, self._stream)
        images = decoder.count()
        times = _Times(self._stream.time_base, self._origin, self.info.fps)
        self._check_end(decoder, times.since_first_ns(decoder.end) or images * times.period_ns)
        return images

    def stamps_ns(self) -> list[int]:
        """The times of its images by their packets, without decoding them."""
        self._open()
        times = _Times(self._stream.time_base, self._origin, self.info.fps)
        found = map(times.since_first_ns, Decoder(self._container, self._stream).stamps())
        known = [i * times.period_ns if at is None else at for i, at in enumerate(found)]
        return sorted(at for at in known if at >= 0)

    def close(self) -> None:
        """End what is being read."""
        self._closed = True

    def _open(self) -> None:
        self._container = open_container(self._path)
        self._stream = video_stream(self._container, self._path)

    def _frames_around(self, start_ns: int) -> Iterator[tuple[int, VideoFrame]]:
        """Timed frames from the one shown at that time, or from one before it, on."""
        self._target_ns = start_ns
        if self._is_ahead(start_ns):
            self._omit_before_target()
            return itertools.chain(list(self._last), self._reading)
        self._last.clear()
        self._reading = self._frames_from(start_ns)
        return self._reading

    def _is_ahead(self, start_ns: int) -> bool:
        """True if reading on gets there sooner than from the key frame before it."""
        key, reached = self._key_before(start_ns), self._last[-1][1].pts if self._last else None
        if reached is None or (key is not None and key > reached):
            return False
        return 0 <= start_ns - self._last[0][0] < (_AHEAD_NS if key is None else _AHEAD_OF_KEY_NS)

    def _key_before(self, time_ns: int) -> int | None:
        """Stamp of the key frame at or before a time; None if the file does not list them."""
        entries, ticks = self._stream.index_entries, self._ticks(time_ns)
        found = -1 if ticks is None else entries.search_timestamp(ticks)
        return entries[found].timestamp if found >= 0 else None

    def _frames_from(self, start_ns: int) -> Iterator[tuple[int, VideoFrame]]:
        """Timed frames, found by seeking."""
        for earlier_ns in _SEEK_EARLIER_NS:
            if self._seek(max(0, start_ns - earlier_ns)):
                frames = self._frames(sought=True)
                first = next(frames, None)
                if first is not None and first[0] <= start_ns:
                    return itertools.chain([first], frames)
        self._open()
        return self._frames(sought=False)

    def _ticks(self, time_ns: int) -> int | None:
        """A time as the file's stamps count it, if they do."""
        time_base = self._stream.time_base
        if self._origin is None or time_base is None:
            return None
        return self._origin + math.floor(time_ns / (time_base * 10**9))

    def _frames(self, sought: bool, omits: bool = True) -> Iterator[tuple[int, VideoFrame]]:
        """Timed frames from where the file was sought to; none if its frames have no times.

        If it ``omits`` some, those are before the target.
        """
        self._decoder = decoder = Decoder(self._container, self._stream)
        times = _Times(self._stream.time_base, self._origin, self.info.fps)
        from_start = self._target_ns == 0 or not sought
        if sought and omits:
            self._omit_before_target()
        last: int | None = None
        for frame in decoder.frames():
            if sought and frame.pts is None:
                self._last.clear()
                return
            time_ns = times.of(frame)
            if time_ns > self._target_ns and decoder.has_omitted_after(last):
                break
            last = frame.pts
            if self._keys is not None and time_ns < self._target_ns:
                self._keys.keep(time_ns, frame)
            yield time_ns, frame
        if decoder.has_omitted_after(last) and self._seek(self._target_ns):
            self._last.clear()
            yield from self._frames(sought, omits=False)
        else:
            self._check_end(decoder, times.end_ns, from_start)

    def _omit_before_target(self) -> None:
        self._decoder.needed = self._ticks(self._target_ns - round(_NEEDED * 1e9 / self.info.fps))

    def _seek(self, time_ns: int) -> bool:
        ticks = self._ticks(time_ns)
        if ticks is None:
            return False
        try:
            self._container.seek(ticks, stream=self._stream)
        except (FFmpegError, OSError):
            return False
        return True

    def _check_end(self, decoder: Decoder, end_ns: int, from_start: bool = True) -> None:
        """Note what was missing or damaged."""
        late_ns = (self.info.promised_ns or 0) - end_ns
        lacks_frames = from_start and decoder.packets < (self.info.frames or 0)
        size, promised = self._path.stat().st_size, promised_bytes(self._path)
        faults = []
        if decoder.damaged:
            faults.append(f"{decoder.damaged} damaged packets were skipped")
        hidden = decoder.expected - decoder.decoded
        if from_start and hidden > max(_MOST_SILENT, _SILENT * decoder.expected):
            faults.append(f"{hidden} of {decoder.expected} images could not be decoded")
        if size < promised:
            what = f"cut off after {size} of at least {promised} bytes"
            faults.append(f"the video ends at {end_ns / 1e9:.2f} s, {what}")
        elif decoder.broken or late_ns > (1e9 / self.info.fps if lacks_frames else _SHORT_NS):
            faults.append(
                f"the video ends at {end_ns / 1e9:.2f} s, before its declared end; the file may"
                " be cut off"
            )
        if end_ns and not self.faults:
            self.faults = faults


def describe(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Summary of a video file; its images are counted, not decoded."""
    video = Video(path)
    shown, images = video.info, video.count()
    duration_s = (shown.duration_ns or 0) / 1e9
    if not duration_s or images < (shown.frames or 0):
        duration_s = images / shown.fps
    hz = round(images / duration_s, 3) if images > 1 else None
    missing = max(0, (shown.frames or 0) - images) if video.faults else 0
    return {
        "path": str(path),
        "format": video.format,
        "start": 0.0,
        "end": duration_s,
        "duration": duration_s,
        "size": Path(path).stat().st_size,
        "messages": images,
        "topics": {"/image_raw": {"type": "sensor_msgs/msg/Image", "messages": images, "hz": hz}},
        "width": shown.width,
        "height": shown.height,
        "fps": shown.fps,
        "codec": shown.codec,
        "lost": {"messages": missing, "bytes": 0, "notes": video.faults},
    }


class _Times:
    """The presentation times of frames since the first, always increasing."""

    def __init__(self, time_base: Fraction | None, origin: int | None, fps: float) -> None:
        self._tick_ns = (time_base or 0) * 10**9
        self._origin = origin
        self.period_ns = round(1e9 / fps)
        self._last_ns: int | None = None
        self._shift_ns = 0
        self.end_ns = 0
        """End of the last frame."""

    def of(self, frame: VideoFrame) -> int:
        """Time of the next frame; by the frame rate if the file does not give it."""
        since_ns = self.since_first_ns(frame.pts)
        time_ns = self.end_ns if since_ns is None else since_ns + self._shift_ns
        if self._last_ns is not None and time_ns <= self._last_ns:
            if self._last_ns - time_ns > _JUMP_BACK_NS:
                self._shift_ns += self.end_ns - time_ns
            time_ns = self._last_ns + self.period_ns // 4
        self._last_ns = time_ns
        self.end_ns = time_ns + (round((frame.duration or 0) * self._tick_ns) or self.period_ns)
        return time_ns

    def since_first_ns(self, pts: int | None) -> int | None:
        """The time of a file's own stamp, as far as it is known."""
        if pts is None or self._origin is None:
            return None
        return round((pts - self._origin) * self._tick_ns)


def _info(
    container: InputContainer, stream: VideoStream, first: VideoFrame, size: Size | None
) -> VideoInfo:
    width, height = size or upright_size(first)
    duration_ns = promised_ns = None
    if stream.duration and stream.time_base:
        duration_ns = promised_ns = round(stream.duration * stream.time_base * 10**9)
    elif container.duration:  # of whatever is the longest in it
        duration_ns = container.duration * 1000
        promised_ns = None if container.streams.audio else duration_ns
    fps = float(stream.average_rate or stream.guessed_rate or _DEFAULT_FPS)
    codec = stream.codec_context.name
    return VideoInfo(width, height, fps, codec, duration_ns, promised_ns, stream.frames or None)


class VideoRecording:
    """A video file as a `ros_visualise.sources.recordings.Recording`; times begin with 0."""

    def __init__(self, path: Path) -> None:
        self._video = Video(path)
        self.path = path
        keys = self._video.key_images
        self.key_image = None if keys is None else keys.at
        self.format = self._video.format
        self.size = self.path.stat().st_size
        self.compression = self._video.info.codec
        self.loss = Loss()
        self.start_ns, self.end_ns = 0, self._video.duration_ns or 0
        kind, info = TopicType("sensor_msgs/msg/Image"), self._video.info
        count = info.frames or round(self.end_ns * info.fps / 1e9) or 1  # it has an image
        self.topics: Mapping[str, TopicInfo] = {_TOPIC: TopicInfo(kind, count)}

    def read(
        self,
        start_ns: int | None = None,
        stop_ns: int | None = None,
        topics: Collection[str] | None = None,
    ) -> Generator[Entry, None, None]:
        """The images in their order."""
        if topics is not None and _TOPIC not in topics:
            return
        with closing(self._video.read(start_ns or 0)) as images:
            for stamp_ns, image in images:
                if stop_ns is not None and stamp_ns >= stop_ns:
                    return
                if start_ns is None or stamp_ns >= start_ns:
                    header = Header(stamp_ns, _FRAME)
                    yield Entry(_TOPIC, stamp_ns, replace(image, header=header))
        for fault in self._video.faults:
            self.loss.add(fault)

    def image_at(self, stamp_ns: int) -> Entry:
        """The last image not after a stamp, else the first."""
        with closing(self._video.read(stamp_ns)) as images:
            shown_ns, image = next(images)
        return Entry(_TOPIC, shown_ns, replace(image, header=Header(shown_ns, _FRAME)))

    def stamps_ns(self) -> Mapping[str, npt.NDArray[np.int64]]:
        """The times of the images, which are not decoded for that."""
        return {_TOPIC: np.array(self._video.stamps_ns(), np.int64)}

    def extras(self) -> Iterator[Extra]:
        return iter(())

    def close(self) -> None:
        self._video.close()

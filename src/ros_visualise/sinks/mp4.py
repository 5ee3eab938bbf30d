"""Recording one topic of images to MP4 (H.264), which plays everywhere."""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import numpy.typing as npt
from av.codec.codec import UnknownCodecError
from av.video.frame import PictureType

from ros_visualise.core.errors import DamagedMessage, OpenError, RecordingError, UsageError
from ros_visualise.data import MEASUREMENTS, Image
from ros_visualise.messages.recorded import Recorded, TopicType, content
from ros_visualise.sinks.files import TargetFile
from ros_visualise.sinks.one_file import FileRecorder
from ros_visualise.vision.measurements import to_picture

log = logging.getLogger(__name__)

TICKS_PER_SECOND = 90_000
"""Ticks of presentation times; 29.97 and 23.976 fps are whole numbers of them."""

_MAX_GAP = 3600 * TICKS_PER_SECOND
_KEYFRAME_TICKS = TICKS_PER_SECOND  # what a seek decodes at most
_INDEX_BYTES = 64  # what one image adds to the index at the file's end, at most
_FRAGMENT_BYTES = 256  # and what its own fragment takes beside it
_ENCODER = "libx264"
_ENCODER_OPTIONS = {
    "preset": "ultrafast",
    "tune": "zerolatency",
    "crf": "20",
    "g": "100000",  # key frames go by time, not by number
    "colorspace": "smpte170m",
    "color_range": "tv",
}
_FILE_OPTIONS = {
    # in fragments while it is written, in one piece with an index when it is finished
    "movflags": "hybrid_fragmented+frag_every_frame+default_base_moof",
    "fflags": "+flush_packets+bitexact",
}
Bytes = npt.NDArray[Any]  # of uint8; OpenCV's own stubs are wider than that

_STUDIO_RANGE = np.round(16 + np.arange(256) * 219 / 255).astype(np.uint8)
_NEUTRAL = 128


def choose_topic(path: Path, topics: Mapping[str, TopicType], named: bool) -> str:
    """The topic that an .mp4 stores: the named one, or the last one of images.

    Raises:
        UsageError: no topic of images, or something else was named.
    """
    images = [topic for topic, kind in topics.items() if kind.data_class is Image]
    if named and (len(topics) > 1 or not images):
        raise UsageError(f"{path}: an .mp4 can store only one image topic; record to .mcap instead")
    if not images:
        raise UsageError(f"{path}: no image topic to record")
    return images[-1]


class Mp4Recorder(FileRecorder):
    """One topic of images in an .mp4 that keeps the times of its images.

    All images take the size of the first one, 16-bit ones are scaled to 8 bit, mosaics become
    colour. While it is written the file can be read up to the last image but one.
    """

    def __init__(self, path: Path, topic: str, overwrite: bool) -> None:
        _require_encoder(path)
        super().__init__(path, [topic], overwrite, live=True)
        self._video: _Video | None = None
        self._timeline = VideoTimeline()
        self._warned = False

    def _take(self, topic: str, message: Any, stamp_ns: int | None) -> None:
        if stamp_ns is None and isinstance(message, Recorded):
            stamp_ns = message.stamp_ns
        image, size, planes = self._planes(message)
        stamp_ns = image.header.stamp_ns if stamp_ns is None else stamp_ns
        try:
            if self._video is None:
                self._video = _Video(self._file, size)
            self._warn_of_scaling(image, size)
            self._add(planes, stamp_ns, self._video)
        except (OSError, av.FFmpegError) as error:
            raise self._fail(error) from None

    def close(self, whole: bool = True) -> None:
        """Finish the video; one without images is removed."""
        if self._closed:
            return
        self._closed = True
        if self._video is None:
            log.warning(
                "%s: no images received, so no video was written%s", self.path, self._file.fate
            )
            self._file.remove()
            return
        try:
            self._video.finish()
        except (OSError, av.FFmpegError) as error:
            raise self._fail(error) from None
        try:
            self._file.close(whole)
        except OSError as error:
            raise self._file.give_up(error, self._video.count) from None

    def _planes(self, message: Any) -> tuple[Image, tuple[int, int], Bytes]:
        """An image, the size of the video, and the image as the encoder takes it.

        Raises:
            DamagedMessage: it is none.
        """
        try:
            image = content(message)
            if not (image.width and image.height):
                raise DamagedMessage(f"an image of {image.width}x{image.height} has no pixels")
            size = even_size(image) if self._video is None else self._video.size
            return image, size, to_i420(image, size)
        except DamagedMessage:
            raise
        except Exception as error:  # OpenCV raises what it happens to meet
            kind = type(message).__name__
            raise DamagedMessage(f"{kind}: cannot be encoded as video: {error}") from error

    def _add(self, planes: Bytes, stamp_ns: int, video: _Video) -> None:
        ticks = self._timeline.place(stamp_ns)
        packets = video.encode(planes, ticks, self._timeline.gap)
        size = video.pending + sum(packet.size + _FRAGMENT_BYTES for packet in packets)
        try:
            self._file.require_room(size + _INDEX_BYTES * video.count)
        except OSError as error:
            raise self._stop(video, error) from None
        video.mux(packets)

    def _stop(self, video: _Video, error: OSError) -> RecordingError:
        """Finish a video that can not go on."""
        if not video.count:
            return self._fail(error)
        self.close(whole=False)
        return self._file.give_up(error, video.count)

    def _warn_of_scaling(self, image: Image, size: tuple[int, int]) -> None:
        if even_size(image) != size and not self._warned:
            width, height = size
            self._warned = True
            log.warning("%s: images of another size are scaled to %dx%d", self.path, width, height)

    def _fail(self, error: Exception) -> RecordingError:
        self._closed = True
        kept = self._video.abandon() if self._video else 0
        return self._file.give_up(error, kept)


class _Video:
    """An encoder and the container that it fills.

    The preset ultrafast keeps up best, at 4K more than twice as fast on edges as superfast and
    half again on colour, and keeps edges clearer at the same crf; its files are a fifth larger,
    small videos in colour twice. Without look-ahead (zerolatency) no image waits in the encoder, so
    that a recording of any size is finished at once.

    Attributes:
        size: (width, height) of all images.
        count: images that it was given.
        pending: bytes that the muxer keeps back until their fragment is whole.
    """

    def __init__(self, file: TargetFile, size: tuple[int, int]) -> None:
        self.size = size
        self.count = self.pending = 0
        self._file = file
        self._kept = 0
        self._next_key = 0
        self._container = av.open(
            file, "w", format="mp4", options=_FILE_OPTIONS, buffer_size=1 << 20
        )
        stream = self._container.add_stream(_ENCODER, rate=30, options=_ENCODER_OPTIONS)
        assert isinstance(stream, av.VideoStream)
        self._stream = stream
        self._stream.width, self._stream.height = size
        self._stream.pix_fmt = "yuv420p"
        self._stream.codec_context.time_base = Fraction(1, TICKS_PER_SECOND)

    def encode(self, planes: Bytes, ticks: int, gap: int) -> list[av.Packet[av.VideoStream]]:
        """The packets of the next image."""
        # not from_numpy_buffer: it loses rows where the height is no multiple of 4
        frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
        frame.pts, frame.time_base = ticks, Fraction(1, TICKS_PER_SECOND)
        if ticks >= self._next_key:
            frame.pict_type = PictureType.I
            self._next_key = ticks + _KEYFRAME_TICKS
        packets = self._stream.encode(frame)
        for packet in packets:
            packet.duration = gap
        return packets

    def mux(self, packets: list[av.Packet[av.VideoStream]]) -> None:
        """Put them into the file; each ends the fragment before it, which is then kept."""
        for packet in packets:
            before = self._file.size
            self._container.mux(packet)
            if self._file.size > before:
                self._file.keep()
                self._kept, self.pending = self.count, 0
            self.pending += packet.size
            self.count += 1

    def finish(self) -> None:
        """Write what is pending, and the index."""
        self.mux(self._stream.encode())
        self._container.close()

    def abandon(self) -> int:
        """End the file after its last complete fragment; returns the number of images in it."""
        self._file.fail()
        with contextlib.suppress(OSError, av.FFmpegError):
            self._container.close()
        return self._kept


def _require_encoder(path: Path) -> None:
    try:
        av.Codec(_ENCODER, "w")
    except UnknownCodecError:
        raise OpenError(
            f"{path}: this PyAV is built without {_ENCODER}; record to .mcap instead, or"
            f" reinstall it with `pip install --force-reinstall av`"
        ) from None


class VideoTimeline:
    """Presentation times for stamps, from zero on and always increasing.

    Gaps between stamps are kept. Where the clock jumps - backwards, or more than an hour ahead - a
    message follows the last one after the last gap.

    Attributes:
        gap: the last gap between two messages, in ticks.
    """

    def __init__(self) -> None:
        self.gap = TICKS_PER_SECOND // 30
        self._ticks: int | None = None
        self._stamp_ns = 0
        self._zero_ns = 0  # the stamp that would be at time zero

    def place(self, stamp_ns: int) -> int:
        """Time of the next message, in ticks."""
        if self._ticks is None:
            self._ticks, self._zero_ns = 0, stamp_ns
        else:
            self._ticks, last = self._next(stamp_ns, self._ticks), self._ticks
            self.gap = self._ticks - last
        self._stamp_ns = stamp_ns
        return self._ticks

    def _next(self, stamp_ns: int, last: int) -> int:
        ticks = _divide((stamp_ns - self._zero_ns) * TICKS_PER_SECOND, 1_000_000_000)
        if stamp_ns <= self._stamp_ns or ticks - last > _MAX_GAP:
            ticks = last + self.gap
            self._zero_ns = stamp_ns - _divide(ticks * 1_000_000_000, TICKS_PER_SECOND)
        return max(ticks, last + 1)


def _divide(numerator: int, denominator: int) -> int:
    return (numerator + denominator // 2) // denominator


def even_size(image: Image) -> tuple[int, int]:
    """(Width, height) of the image, one more where it is odd."""
    return image.width + image.width % 2, image.height + image.height % 2


def to_i420(image: Image, size: tuple[int, int]) -> Bytes:
    """The planes Y, U and V below one another: (height * 3 / 2, width).

    An odd row or column is doubled; an image of any other size is scaled.
    """
    pixels, order = _to_8_bit(image)
    if even_size(image) == size:
        right, bottom = size[0] - image.width, size[1] - image.height
        if right or bottom:
            pixels = cv2.copyMakeBorder(pixels, 0, bottom, 0, right, cv2.BORDER_REPLICATE)
    else:
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    if order == "gray":
        return _gray_to_i420(pixels)
    return cv2.cvtColor(pixels, getattr(cv2, f"COLOR_{order}2YUV_I420"))


def _to_8_bit(image: Image) -> tuple[Bytes, str]:
    """Pixels, and the order of their channels as OpenCV names it; a mosaic becomes colour."""
    pixels: Bytes = image.pixels
    if image.encoding in MEASUREMENTS:
        return to_picture(pixels), "BGR"
    if pixels.dtype == np.uint16:
        pixels = cv2.convertScaleAbs(pixels, alpha=255 / 65535)
    kind = image.encoding.rstrip("0123456789")
    if kind == "mono":
        return np.ascontiguousarray(pixels, np.uint8), "gray"
    if kind.startswith("bayer_"):
        pattern = kind.removeprefix("bayer_").upper()
        return cv2.cvtColor(pixels, getattr(cv2, f"COLOR_Bayer{pattern}2BGR")), "BGR"
    return np.ascontiguousarray(pixels, np.uint8), kind.upper()


def _gray_to_i420(gray: Bytes) -> Bytes:
    height, width = gray.shape
    planes = np.full((height * 3 // 2, width), _NEUTRAL, np.uint8)
    cv2.LUT(gray, _STUDIO_RANGE, dst=planes[:height])
    return planes

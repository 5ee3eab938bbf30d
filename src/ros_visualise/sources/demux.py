"""Opening files with FFmpeg and reading their packets, also of damaged files."""

from __future__ import annotations

import io
import os
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from shlex import quote

import av
from av.container import InputContainer
from av.error import FFmpegError, InvalidDataError
from av.packet import Packet
from av.stream import Disposition
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from ros_visualise.core.errors import OpenError
from ros_visualise.core.limits import check_frame, frame_pixels, frames_at_once, within_limits
from ros_visualise.core.regular_files import is_of_the_shell, open_file, open_regular

_UNKNOWN_BITS = 24  # of a pixel
_BUFFER_BYTES = 1 << 16
_AHEAD, _AHEAD_BYTES = 16, 1 << 24
"""Packets read before they are decoded: codecs reorder no more than 16 frames."""
_RECENT = 4 * _AHEAD  # stamps, also of those that are being decoded
_PLAYLISTS = (b"ffconcat version", b"#EXTM3U")


class _File(io.FileIO):
    """A file that is closed when FFmpeg no longer refers to it."""

    def __del__(self) -> None:
        self.close()


class NoVideo(OpenError):
    """A file in which FFmpeg finds no video."""


def open_container(path: Path) -> InputContainer:
    """A file of any name, opened by FFmpeg.

    FFmpeg gets the bytes and may open nothing itself, so that no file can make it read other files
    or addresses, as a playlist does.

    Raises:
        OpenError: it cannot be opened; the message says what to do.
    """
    _check_file(path)
    try:
        return av.open(
            _File(str(path.absolute()), opener=open_regular),
            "r",
            metadata_errors="replace",
            buffer_size=_BUFFER_BYTES,
            options={"protocol_whitelist": "none"},
        )
    except PermissionError as error:
        raise OpenError.unreadable(path, error) from None
    except (FFmpegError, OSError) as error:
        why = "" if isinstance(error, InvalidDataError) else f"{error.strerror or error}; "
        raise _no_video(path, why) from None


def video_stream(container: InputContainer, path: Path) -> VideoStream:
    """The first video stream but cover pictures, decoded by all threads; raises OpenError."""
    streams = [s for s in container.streams.video if not s.disposition & Disposition.attached_pic]
    if container.format.name == "tty" or not container.streams:
        raise _no_video(path)
    if not streams:
        kinds = " and ".join(sorted({s.type for s in container.streams} - {"video"})) or "pictures"
        raise NoVideo(f"{path}: holds {kinds} but no video; give a video file")
    if streams[0].codec_context is None:
        raise OpenError(f"{path}: unsupported codec; convert it: ffmpeg -i IN OUT")
    streams[0].thread_type = "AUTO"
    with within_limits(path):
        limit_frames(streams[0])
    return streams[0]


def limit_frames(stream: VideoStream) -> None:
    """Limit the memory of decoding, also of frames that become larger later; raises TooLarge."""
    codec = stream.codec_context
    bits = codec.format.padded_bits_per_pixel if codec.format else _UNKNOWN_BITS
    check_frame(codec.width, codec.height, bits)
    threads = frames_at_once(codec.width, codec.height, bits)
    if threads < (os.cpu_count() or 1):
        codec.thread_count = threads
    codec.options = {"max_pixels": str(frame_pixels(bits))}


class Decoder:
    """Decodes as much as possible, and counts the rest.

    Attributes:
        needed: before this time, in ticks of the stream, frames on which no others depend may be
            omitted; None: none.
    """

    def __init__(self, container: InputContainer, stream: VideoStream) -> None:
        self._container, self._stream = container, stream
        self.packets = self.damaged = 0
        self.expected = self.decoded = 0  # frames of the packets that were decoded
        self.end: int | None = None  # where the last packet ends, in ticks of the stream
        self.broken = False  # reading failed before the end
        self.needed: int | None = None
        self._omitted: int | None = None  # last stamp, in ticks, of what may have been omitted
        self._recent: deque[int | None] = deque(maxlen=_RECENT)  # the stamps of packets
        self._knows_next = False

    def frames(self) -> Iterator[VideoFrame]:
        """All frames, in order of presentation."""
        for packet in self._packets_ahead():
            self._omit(packet)
            try:
                decoded = self._stream.decode(packet)
            except FFmpegError:
                self.damaged += 1
                continue
            self.expected += packet is not None and not packet.is_discard
            self.decoded += len(decoded)
            yield from decoded

    def has_omitted_after(self, stamp: int | None) -> bool:
        """True if a frame after this stamp may have been omitted."""
        return self._omitted is not None and (stamp is None or stamp < self._omitted)

    def is_last_until(self, stamp: int, end: int) -> bool:
        """True if no frame after a decoded one, up to a later stamp, is to come; False: unknown."""
        is_known = self._knows_next and None not in self._recent
        return is_known and not any(stamp < one <= end for one in self._recent if one is not None)

    def count(self) -> int:
        """The number of frames, without decoding them."""
        return sum(packet is not None and not packet.is_discard for packet in self._packets())

    def stamps(self) -> list[int | None]:
        """The stamps of the frames, in ticks of the stream, without decoding them."""
        return [one.pts for one in self._packets() if one is not None and not one.is_discard]

    def _packets_ahead(self) -> Iterator[Packet[VideoStream] | None]:
        """The packets; some more are read before each, so that the next frames are known."""
        packets = self._packets()
        ahead: deque[Packet[VideoStream] | None] = deque()
        ahead_bytes, is_end = 0, False
        while ahead or not is_end:
            while not is_end and len(ahead) <= _AHEAD and ahead_bytes <= _AHEAD_BYTES:
                packet = next(packets)
                ahead.append(packet)
                is_end = packet is None
                if packet is not None:
                    ahead_bytes += packet.size
                    self._recent.append(packet.pts)
            self._knows_next = is_end or len(ahead) > _AHEAD
            first = ahead.popleft()
            ahead_bytes -= 0 if first is None else first.size
            yield first

    def _packets(self) -> Iterator[Packet[VideoStream] | None]:
        try:
            for packet in self._container.demux(self._stream):
                if packet.size:
                    self.packets += 1
                    self._reach(packet)
                    yield packet
        except (FFmpegError, OSError, IndexError):  # the last of a damaged table of streams
            self.broken = True
        yield None

    def _omit(self, packet: Packet[VideoStream] | None) -> None:
        stamp = None if packet is None else packet.pts
        may_be = self.needed is not None and stamp is not None and stamp < self.needed
        if may_be and stamp is not None:
            self._omitted = max(stamp, self._omitted or stamp)
        if may_be or self._omitted is not None:
            self._stream.codec_context.skip_frame = "NONREF" if may_be else "DEFAULT"

    def _reach(self, packet: Packet[VideoStream]) -> None:
        if packet.pts is not None:
            self.end = max(self.end or 0, packet.pts + (packet.duration or 0))


def _check_file(path: Path) -> None:
    try:
        if path.is_dir():
            raise OpenError(f"{path}: a folder; give a video file in it")
        if not path.exists():
            raise OpenError.missing(path)
        if not (path.is_file() or is_of_the_shell(path)):
            raise OpenError(
                f"{path}: not a regular file; for a camera run: ros-visualise camera"
                f" {quote(str(path))}"
            )
        if path.is_file() and path.stat().st_size == 0:
            raise OpenError(f"{path}: the file is empty; copy or record it again")
    except OSError as error:
        raise OpenError.unreadable(path, error) from None


def _no_video(path: Path, why: str = "") -> OpenError:
    if is_of_the_shell(path):
        return OpenError(f"{path}: a pipe, which can be read only once; write it to a file first")
    with open_file(path) as file:
        head = file.read(16)
    if head.startswith(_PLAYLISTS):
        return OpenError(f"{path}: a playlist, which only names videos; give one of them")
    if head[4:8] == b"ftyp":
        return OpenError(
            f"{path}: {why}cut off, so its index is missing; copy it again, or repair it with"
            " untrunc"
        )
    return NoVideo(f"{path}: {why}not a video that FFmpeg can read; give a video file")

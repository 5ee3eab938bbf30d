"""Addresses of live cameras, opened by FFmpeg, and the stamps of their images."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from glob import glob
from pathlib import Path

import av
from av.container import InputContainer
from av.error import ExitError, FFmpegError
from av.video.frame import VideoFrame

from ros_visualise.core.errors import OpenError, TooLarge
from ros_visualise.core.printing import without_secrets
from ros_visualise.sources.demux import limit_frames
from ros_visualise.sources.video_pixels import Size

_OPEN_S = 10.0  # a stream may take that long until its first keyframe
_LOST_NS = 1_000_000_000
_DRIFT = 1e-4  # of a camera's clock against ours
_NETWORK = {
    "fflags": "nobuffer",
    "flags": "low_delay",
    "rtsp_transport": "tcp",
    "protocol_blacklist": "file",  # no stream may have files of this machine read
}
_TRY_TEST = "without a camera, try the test picture, which is the camera called test"


@dataclass(frozen=True)
class Address:
    """FFmpeg's arguments for a camera; ``name`` is its name in messages."""

    name: str
    file: str
    format: str | None = None
    options: dict[str, str] = field(default_factory=dict)
    is_paced: bool = False  # it gives frames as fast as they are read
    is_device: bool = False  # its times are those of the wall clock, and reads have no timeout


def is_live(source: str) -> bool:
    """True if it names a camera: a device, its number, a URL, ``test`` or ``lavfi:GRAPH``."""
    if Path(source).exists():
        return Path(source).is_char_device()
    return source == "test" or source.isdecimal() or "://" in source or source.startswith("lavfi:")


def may_read_files(uri: str) -> bool:
    """True unless it is a device, the test pattern or a URL: lavfi, for example, opens files."""
    is_url = "://" in uri and not uri.startswith(("file:", "lavfi:"))
    is_device = uri.isdecimal() or re.fullmatch(r"/dev/video\d+", uri)
    return not (uri == "test" or is_device or is_url)


def parse_address(uri: str, size: Size | None = None, fps: float = 0) -> Address:
    """A device (``/dev/video0`` or ``0``), a URL, ``test`` or ``lavfi:GRAPH``; raises OpenError."""
    width, height = size or (640, 480)
    if uri == "test":
        graph = f"testsrc2=size={width}x{height}:rate={fps or 30:g}"
        return Address(uri, graph, "lavfi", is_paced=True)
    if uri.startswith("lavfi:"):
        return Address(uri, uri.removeprefix("lavfi:"), "lavfi", is_paced=True)
    if uri.startswith("file:"):
        raise _not_a_camera(uri)
    if re.match(r"[a-z][a-z0-9+.]*://", uri):
        return Address(without_secrets(uri), uri, None, _NETWORK)
    device = f"/dev/video{int(uri)}" if uri.isascii() and uri.isdecimal() else uri
    _check_device(device)
    wanted = {"video_size": f"{width}x{height}"} if size else {}
    wanted |= {"framerate": f"{fps:g}"} if fps else {}
    return Address(device, device, "v4l2", {"timestamps": "abs", **wanted}, is_device=True)


def open_live(address: Address, timeout_s: float) -> InputContainer:
    """A camera, opened by FFmpeg; raises OpenError."""
    waits = (max(_OPEN_S, timeout_s), timeout_s)
    try:
        container = av.open(
            address.file, format=address.format, options=address.options, timeout=waits
        )
    except (FFmpegError, OSError) as error:
        raise OpenError(f"{address.name}: {what_failed(error)}; {_TRY_TEST}") from None
    try:
        _prepare(container, address.name)
    except BaseException:
        container.close()
        raise
    return container


def _prepare(container: InputContainer, name: str) -> None:
    """Check that a camera's video can be decoded, and set up its decoder."""
    if not container.streams.video:
        raise OpenError(f"{name}: sends no video; {_TRY_TEST}")
    stream = container.streams.video[0]
    if stream.codec_context is None:
        raise OpenError(f"{name}: unsupported codec; have it send H.264 or MJPEG")
    try:
        limit_frames(stream)
    except TooLarge as error:
        raise OpenError(f"{name}: {error}") from None
    stream.thread_type = "SLICE"  # threads by frame would keep frames back


def what_failed(error: Exception) -> str:
    """The reason in a few words."""
    if isinstance(error, ExitError):
        return "no answer"
    return str(getattr(error, "strerror", None) or error)


class CaptureStamps:
    """Times of capture by the wall clock; make another one when the clock was set.

    A network stream does not have them: there, the stream's own times are shifted so that the
    image with the shortest delay so far gets its time of arrival. So they have no jitter, and are
    late only by the shortest delay. Times of a device that are far from the times of arrival are by
    another clock, and are shifted in the same way.
    """

    def __init__(self, address: Address) -> None:
        self._is_device = address.is_device
        self._shift_ns: float | None = None
        self._last_ns = 0

    def of(self, frame: VideoFrame, arrival_ns: int) -> int:
        """The stamp of a frame that arrived at that time; always later than the last."""
        stamp_ns = arrival_ns
        if frame.pts is not None and frame.time_base is not None:
            own_ns = round(frame.pts * frame.time_base * 10**9)
            is_now = self._is_device and abs(arrival_ns - own_ns) < _LOST_NS
            stamp_ns = own_ns if is_now else self._shifted(own_ns, arrival_ns)
        self._last_ns = max(stamp_ns, self._last_ns + 1)
        return self._last_ns

    def _shifted(self, own_ns: int, arrival_ns: int) -> int:
        shift_ns = arrival_ns - own_ns
        before_ns = shift_ns if self._shift_ns is None else self._shift_ns
        if abs(shift_ns - before_ns) > _LOST_NS:
            before_ns = shift_ns
        drift_ns = max(0, arrival_ns - self._last_ns) * _DRIFT if self._last_ns else 0
        self._shift_ns = min(shift_ns, before_ns + drift_ns)
        return round(own_ns + self._shift_ns)


def _check_device(device: str) -> None:
    there = f"devices: {', '.join(sorted(glob('/dev/video*'))) or 'none'}"
    if os.path.isfile(device) or os.path.isdir(device):
        raise _not_a_camera(device)
    if not os.path.exists(device) and device.startswith("/dev/"):
        raise OpenError(f"no such device {device}; {there}; {_TRY_TEST}")
    if not os.path.exists(device):
        raise OpenError(f"no camera {device!r}: give a device, a URL or test; {there}")


def _not_a_camera(uri: str) -> OpenError:
    return OpenError(f"{uri}: not a camera; a file is played as a video")

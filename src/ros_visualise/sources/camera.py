"""Live cameras, by PyAV: V4L2 devices, network streams, and FFmpeg's test picture."""

from __future__ import annotations

import logging
import os
import re
import threading
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from glob import glob
from pathlib import Path
from shlex import quote

import av
from av.container import InputContainer
from av.error import ExitError, FFmpegError
from av.video.frame import VideoFrame

from ros_visualise.core import supervision
from ros_visualise.core.errors import OpenError, ParameterError
from ros_visualise.core.limits import within_limits
from ros_visualise.core.params import Value
from ros_visualise.core.printing import without_secrets
from ros_visualise.core.rate import Clock, Steady, WallClock
from ros_visualise.data import Image
from ros_visualise.sources.demux import limit_frames
from ros_visualise.sources.v4l2_controls import set_controls
from ros_visualise.sources.video_pixels import FrameConverter, Size

log = logging.getLogger(__name__)

_OPEN_S = 10.0  # a stream may take that long until its first keyframe
_LOST_NS = 1_000_000_000
_DRIFT = 1e-4  # of a camera's clock against ours
_NETWORK = {
    "fflags": "nobuffer",
    "flags": "low_delay",
    "rtsp_transport": "tcp",
    "protocol_blacklist": "file",  # no stream may have files of this machine read
}
_TRY_TEST = "for a test pattern run: ros-visualise camera test (ROS: device:=test)"
_BACK_OFF_S = (0.5, 10.0)
_IDLE_S = 0.1


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
        raise OpenError(f"{name}: unsupported codec; set the camera to H.264 or MJPEG")
    with within_limits(name):
        limit_frames(stream)
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
    return OpenError(f"{uri}: not a camera; for a file run: ros-visualise video {quote(uri)}")


class LiveCamera:
    """A live camera: it gives the newest image, and is reopened when it fails.

    Stamps are wall clock times. When the clock is set, as NTP does, they jump with it, ahead or
    back, and a warning is logged once.

    Args:
        uri: a device (``/dev/video0`` or ``0``), a URL, ``test``, or ``lavfi:GRAPH``.
        size: (width, height) to scale to; a device is asked for it.
        fps: frame rate to ask a device for; 0 leaves it to the device.
        timeout_s: after that long without an image it has failed.
        controls: of a device: name -> value, set whenever it is opened; see `v4l2_controls`.
        clock: measures time.

    Attributes:
        dropped: number of images that were replaced by newer ones.

    Raises:
        OpenError: it cannot be opened; the message lists the devices.
    """

    def __init__(
        self,
        uri: str,
        size: Size | None = None,
        fps: float = 0,
        timeout_s: float = 2.0,
        controls: Mapping[str, Value] | None = None,
        clock: Clock | None = None,
    ) -> None:
        self._address = parse_address(uri, size, fps)
        self._name = f"camera {self._address.name}"
        self._controls = dict(controls or {})
        self._timeout_s = timeout_s
        self._clock = clock or WallClock()
        self._converter = FrameConverter(size)
        self._steady = Steady()
        self._changed = threading.Condition()
        self._newest: tuple[int, Image] | None = None
        self._failure: OpenError | None = None
        self._opened = self._closed = self._reported = False
        self._received = 0
        self.dropped = 0
        supervision.start(self._name, self._watch)
        self._await_opened()

    def images(self) -> Iterator[tuple[int, Image] | None]:
        """(Stamp, newest image), or None after a while without one, until it is closed."""
        last_ns = self._clock.monotonic_ns()
        while not self._closed:
            newest = self._take()
            now_ns = self._clock.monotonic_ns()
            last_ns = last_ns if newest is None else now_ns
            if self._address.is_device and now_ns - last_ns > self._timeout_s * 1e9:
                # its read has no time-out, as that of a stream has
                self._report(f"no image for {self._timeout_s:g} s")
            yield newest

    def set_controls(self, controls: Mapping[str, Value]) -> None:
        """Set controls of the device now, and whenever it is reopened; raises ParameterError."""
        set_controls(self._address.name, controls)
        self._controls = {**self._controls, **controls}

    def close(self) -> None:
        """End it, without waiting for a blocked read: that ends by its own timeout."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def _take(self) -> tuple[int, Image] | None:
        with self._changed:
            if self._newest is None and not self._closed:
                self._changed.wait(_IDLE_S)
            newest, self._newest = self._newest, None
            return newest

    def _await_opened(self) -> None:
        with self._changed:
            try:
                self._changed.wait_for(lambda: self._opened or self._failure or self._closed)
            except KeyboardInterrupt:
                self._closed = True
                raise
        if self._failure is not None:
            raise self._failure

    def _watch(self) -> None:
        """The reader's thread: open and read, and again after a while, until it is closed."""
        shortest_s, longest_s = _BACK_OFF_S
        delay_s = shortest_s
        try:
            while not self._closed:
                received = self._received
                reason = self._read()
                if self._failure is not None:
                    return
                delay_s = shortest_s if self._received > received else min(2 * delay_s, longest_s)
                self._report(reason)
                self._wait_until(self._clock.monotonic_ns() + round(delay_s * 1e9))
        finally:
            self.close()  # whatever ended it

    def _read(self) -> str:
        """Read until it fails; returns why."""
        try:
            with closing(open_live(self._address, self._timeout_s)) as container:
                self._restore_controls()
                self._note(opened=True)
                stamps, start_ns = CaptureStamps(self._address), self._clock.monotonic_ns()
                for frame in container.decode(video=0):
                    if self._closed:
                        break
                    if self._address.is_paced and frame.time is not None:
                        self._wait_until(start_ns + round(frame.time * 1e9))
                    now_ns = self._clock.now_ns()
                    self._steady.of(now_ns, self._clock.monotonic_ns())
                    if self._steady.step_ns:
                        self._report_step(self._steady.step_ns / 1e9)
                        stamps = CaptureStamps(self._address)
                    self._publish(stamps.of(frame, now_ns), frame)
        except OpenError as error:
            self._note(failure=None if self._opened else error)
            return str(error)
        except FFmpegError as error:
            return what_failed(error)
        except supervision.ERRORS as error:
            supervision.note(self._name, error)
            reason = f"{type(error).__name__}: {error}"
            failure = OpenError(f"{self._address.name}: cannot be read: {reason}")
            self._note(failure=None if self._opened else failure)
            return reason
        return "the stream ended"

    def _restore_controls(self) -> None:
        try:
            set_controls(self._address.name, self._controls)
        except ParameterError as error:
            log.warning("camera %s", error)

    def _publish(self, stamp_ns: int, frame: VideoFrame) -> None:
        image = self._converter.image(frame)
        with self._changed:
            self.dropped += self._newest is not None
            self._newest = stamp_ns, image
            self._received += 1
            if self._reported:
                log.info("%s: connection restored", self._name)
            self._reported = False
            self._changed.notify_all()

    def _report_step(self, step_s: float) -> None:
        way = "ahead" if step_s > 0 else "back"
        log.warning("%s: the clock was set %s by %.1f s", self._name, way, abs(step_s))

    def _report(self, reason: str) -> None:
        with self._changed:
            if not (self._reported or self._closed):
                self._reported = True
                log.warning("%s: %s; trying again", self._name, reason)

    def _note(self, opened: bool = False, failure: OpenError | None = None) -> None:
        with self._changed:
            self._opened |= opened
            self._failure = failure
            self._changed.notify_all()

    def _wait_until(self, until_ns: int) -> None:
        with self._changed:
            while not self._closed and self._clock.monotonic_ns() < until_ns:
                self._clock.wait(self._changed, until_ns)

"""Live cameras, by PyAV: V4L2 devices, network streams, and FFmpeg's test picture."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator, Mapping
from contextlib import closing

from av.error import FFmpegError
from av.video.frame import VideoFrame

from ros_visualise.core import supervision
from ros_visualise.core.errors import OpenError, ParameterError
from ros_visualise.core.params import Value
from ros_visualise.core.rate import Clock, Steady, WallClock
from ros_visualise.data import Image
from ros_visualise.sources.live import CaptureStamps, open_live, parse_address, what_failed
from ros_visualise.sources.v4l2_controls import set_controls
from ros_visualise.sources.video_pixels import FrameConverter, Size

log = logging.getLogger(__name__)

_BACK_OFF_S = (0.5, 10.0)
_IDLE_S = 0.1


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
                        self._say_step(self._steady.step_ns / 1e9)
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
        return "it ended"

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

    def _say_step(self, step_s: float) -> None:
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

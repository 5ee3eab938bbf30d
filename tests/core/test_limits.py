"""Small inputs that stand for gigabytes are refused by their heads, and take little memory."""

import json
import struct
import subprocess
import sys
import zlib
from types import SimpleNamespace

import av
import numpy as np
import pytest

from ros_visualise.core import limits
from ros_visualise.core.errors import OpenError, TooLarge, UsageError
from ros_visualise.data import CompressedImage, Image
from ros_visualise.messages import to_message
from ros_visualise.messages.definitions import Definitions
from ros_visualise.vision.compression import decompress

MB = 1 << 20


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(width, height, depth=8, color=2):
    """The head of such a picture, and a kilobyte of its pixels."""
    head = struct.pack(">IIBBBBB", width, height, depth, color, 0, 0, 0)
    pixels = zlib.compress(bytes(1000))
    palette = chunk(b"PLTE", bytes(6)) if color == 3 else b""
    parts = chunk(b"IHDR", head) + palette + chunk(b"IDAT", pixels) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + parts


def tiff(width, height):
    tags = ((256, 4, width), (257, 4, height), (258, 3, 8), (259, 3, 1), (262, 3, 1), (273, 4, 8))
    tags += ((277, 3, 1), (278, 4, height), (279, 4, 100))
    entries = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in tags)
    return b"II*\0\x6c\0\0\0" + bytes(100) + struct.pack("<H", len(tags)) + entries + bytes(4)


def jpeg(width, height):
    import cv2
    import numpy as np

    data = cv2.imencode(".jpg", np.zeros((8, 8, 3), np.uint8))[1].tobytes()
    at = data.index(b"\xff\xc0") + 5
    return data[:at] + struct.pack(">HH", height, width) + data[at + 4 :]


def pgm(width, height):
    return b"P5\n%d %d\n255\n" % (width, height) + bytes(100)


@pytest.fixture
def little_memory():
    limits.set_max_memory(64 * MB)  # 4 MB for an image, or for what is unpacked
    yield
    limits.set_max_memory(limits.DEFAULT_MEMORY)


def peak_of(*arguments):
    """A command: exit status, what it said, and the bytes that it took at most."""
    code = (
        "import json, resource, subprocess, sys\n"
        "done = subprocess.run([sys.executable, '-m', 'ros_visualise', *sys.argv[1:]],"
        " capture_output=True, text=True, timeout=100)\n"
        "peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss << 10\n"
        "print(json.dumps([done.returncode, done.stderr, peak]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)], capture_output=True, check=True
    )
    return json.loads(done.stdout)


@pytest.mark.parametrize("make", [png, jpeg, tiff, pgm])
def test_a_picture_is_refused_by_its_head(make):
    import numpy as np

    data = np.frombuffer(make(32000, 32000), np.uint8)
    with pytest.raises(TooLarge, match=r"32000x32000 takes .* 128 MiB; .* --max-memory \d+G"):
        decompress(CompressedImage(data, "picture"))


@pytest.mark.parametrize("make", [png, pgm])
def test_nobody_is_advised_to_take_more_memory_than_a_computer_has(make):
    data = np.frombuffer(make(2**31 - 1, 2**31 - 1), np.uint8)
    with pytest.raises(TooLarge, match="limit: 128 MiB; its declared size must be wrong; copy"):
        decompress(CompressedImage(data, "picture"))


@pytest.mark.usefixtures("little_memory")
@pytest.mark.parametrize(
    "form", [{"depth": 16}, {"color": 3}, {"color": 6}], ids=["16 bit", "palette", "alpha"]
)
def test_the_bytes_are_those_that_opencv_makes_of_a_pixel(form):
    data = np.frombuffer(png(1200, 1000, **form), np.uint8)
    with pytest.raises(TooLarge, match="an image of 1200x1000 takes"):
        decompress(CompressedImage(data, "png"))


@pytest.mark.parametrize(
    ("text", "size"),
    [("4G", 4 << 30), ("500M", 500 << 20), ("1.5GiB", 3 << 29), ("67108864", 64 * MB)],
)
def test_memory_is_given_in_bytes(text, size):
    assert limits.parse_memory(text) == size


@pytest.mark.parametrize("text", ["", "0", "-4G", "4X", "1M", "nan", "four"])
def test_what_is_no_memory_is_refused(text):
    with pytest.raises(UsageError, match="give a size such as 4G or 500M, at least 64M"):
        limits.parse_memory(text)


def test_a_size_to_scale_to_is_refused_in_one_line():
    status, said, _ = peak_of("demo", "landscape", "--size", "16384x16384", "--view", "none")
    assert status == 2
    assert said.splitlines() == [
        "ros-visualise: size=16384x16384: an image of 16384x16384 takes 768 MiB in colour;"
        " limit: 128 MiB; if you trust it, add --max-memory 12G"
    ]


@pytest.mark.usefixtures("little_memory")
def test_gray_counts_as_the_colours_that_are_made_of_it():
    most, more = np.zeros((1000, 1398), np.uint8), np.zeros((1000, 1399), np.uint8)
    types = Definitions("ros1").types
    assert Image.read(to_message(Image(most, "mono8"), types)).width == 1398
    with pytest.raises(TooLarge, match="an image of 1399x1000 takes 4 MiB in colour; limit: 4 MiB"):
        Image.read(to_message(Image(more, "mono8"), types))


def test_a_node_makes_no_image_that_is_too_large():
    sides = ("--set", "filters.width=16384", "--set", "filters.height=16384")
    status, said, peak = peak_of(
        "demo", "landscape", "--frames", 3, "--rate", 0, "--view", "none", *sides
    )
    assert status == 1
    assert said.count("an image of 16384x16384 takes 768 MiB") == 1
    assert "filters: 3 of 3 dropped (error)" in said
    assert "/image_raw: 3 messages" in said
    assert peak < 600 * MB


@pytest.mark.parametrize("command", ["info", "video"])
def test_a_film_of_large_frames_is_refused_before_one_is_decoded(tmp_path, command):
    path = tmp_path / "film.avi"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mjpeg", rate=25)
        stream.width, stream.height, stream.pix_fmt = 8400, 8400, "yuvj420p"
        frame = av.VideoFrame(8400, 8400, "yuvj420p")
        container.mux(stream.encode(frame))
        container.mux(stream.encode())
    status, said, peak = peak_of(command, path)
    assert (status, len(said.splitlines())) == (2, 1)
    assert "film.avi: frames of 8400x8400 take 101 MiB each; limit: 51 MiB" in said
    assert peak < 400 * MB


def test_a_disk_keeps_room(tmp_path):
    with pytest.raises(OpenError, match="is free; make room, or set TMPDIR"):
        limits.check_disk(tmp_path, 2**60)
    limits.check_disk(tmp_path, 1)


@pytest.mark.parametrize(("total", "reserve"), [(2**40, 2**30), (2**32, 2**32 // 20)])
def test_a_disk_keeps_1_gib_or_less(tmp_path, monkeypatch, total, reserve):
    usage = SimpleNamespace(total=total, used=0, free=reserve + 100)
    monkeypatch.setattr(limits.shutil, "disk_usage", lambda _: usage)
    limits.check_disk(tmp_path, 100)
    with pytest.raises(OpenError, match="is free; make room"):
        limits.check_disk(tmp_path, 101)

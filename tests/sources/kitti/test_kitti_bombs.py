"""Files of KITTI's that would take gigabytes: left out like others that are damaged."""

import os
import struct
import zlib

import pytest

from ros_visualise.sources.kitti.files import list_files, read_lines
from ros_visualise.sources.kitti.oxts import read_samples
from ros_visualise.sources.kitti.sensors import check_png
from ros_visualise.sources.series import DamagedFile


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def test_an_image_of_gigabytes_is_refused_by_its_head(tmp_path):
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", 32000, 32000, 8, 0, 0, 0, 0))
    rest = chunk(b"IDAT", zlib.compress(bytes(1000))) + chunk(b"IEND", b"")
    with pytest.raises(DamagedFile, match=r"an image of 32000x32000 takes .* --max-memory 46G"):
        check_png(tmp_path / "0000000000.png", b"\x89PNG\r\n\x1a\n" + head + rest)


def test_a_file_of_gigabytes_is_not_read(tmp_path):
    path = tmp_path / "0000000000.png"
    path.touch()
    os.truncate(path, 2**31 + 1)
    with pytest.raises(DamagedFile, match=r"0000000000\.png: a file of 2\.0 GiB; limit: 128 MiB"):
        list_files(tmp_path, "png").read(0)


def test_a_text_whose_lines_would_take_gigabytes_is_not_read(tmp_path):
    path = tmp_path / "times.txt"
    path.touch()
    os.truncate(path, 17 << 20)
    with pytest.raises(DamagedFile, match=r"times\.txt: numbers of 17 MiB; limit: 16 MiB"):
        read_lines(path)


def test_a_sample_of_millions_of_numbers_is_damaged(tmp_path):
    path = tmp_path / "0000000000.txt"
    path.touch()
    os.truncate(path, 17 << 20)
    whole, rows, [damaged] = read_samples(list_files(tmp_path, "txt"))
    assert (whole, len(rows)) == ([], 0)
    assert "numbers of 17 MiB; limit: 16 MiB" in damaged.why

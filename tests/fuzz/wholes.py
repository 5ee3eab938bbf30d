"""Whole inputs of every kind, small: made ones, and real ones where there are some."""

import os
import struct
from collections.abc import Callable
from pathlib import Path

import cv2
import made_bags
import made_mcaps
import made_videos
import numpy as np
from made_mcaps import CompressionType, StoragePlugin

from fuzz.page import whole_messages

_STAMPS_NS = [10**9 + number * 10_000_000 for number in range(60)]
_REAL = {
    "bag": ("bags/evo_tf_example.bag", "bags/foxglove_example-lz4.bag"),
    "db3": ("bags/evo_tf_example", "bags/plotjuggler_rosbag2_test"),
    "ulg": ("trajectory/px4_ulog/sample_log_small.ulg",),
    "srt": ("trajectory/dji_srt/mavic_mini.SRT",),
    "video": ("video/gopro_karma_drone.mp4",),
    "kitti": ("oxts/2011_09_30_drive_0016_sync",),
}


def make(folder: Path, real: bool) -> dict[str, list[Path]]:
    """Kind -> whole inputs of that kind."""
    made = {kind: maker(folder) for kind, maker in _MAKERS.items()}
    if not real:
        return made
    data = Path(os.environ.get("ROS_VISUALISE_DATA", "../shared/data"))
    for kind, names in _REAL.items():
        made.setdefault(kind, []).extend(data / name for name in names if (data / name).exists())
    return made


def _bags(folder: Path) -> list[Path]:
    paths = []
    for compression in ("none", "lz4", "bz2"):
        path = folder / f"{compression}.bag"
        made_bags.drive(path, compression, steps=6)
        paths.append(path)
    open_one = folder / "unindexed.bag"
    open_one.write_bytes(made_bags.without_index(paths[1].read_bytes()))
    return [*paths, open_one]


def _mcaps(folder: Path) -> list[Path]:
    paths = []
    for compression in (CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD):
        path = folder / f"{compression.name}.mcap"
        options = {"compression": compression, "enable_crcs": compression.name != "NONE"}
        made_mcaps.write_mcap(path, made_mcaps.numbered(_STAMPS_NS), **options)
        paths.append(path)
    bare = folder / "no_summary.mcap"
    bare.write_bytes(paths[0].read_bytes()[: made_mcaps.parts(paths[0])[-8].end])
    return [*paths, bare]


def _folder(storage: StoragePlugin) -> Callable[[Path], list[Path]]:
    def make_one(folder: Path) -> list[Path]:
        path = folder / storage.name
        made_mcaps.write_bag(path, made_mcaps.numbered(_STAMPS_NS), storage)
        return [path]

    return make_one


def _videos(folder: Path) -> list[Path]:
    images = made_videos.numbered(12)
    mp4 = {"codec": "libx264", "pix_fmt": "yuv420p"}
    return [
        made_videos.write_video(folder / "a.mkv", images),
        made_videos.write_video(folder / "a.mp4", images, **mp4),
    ]


def _drives(folder: Path) -> list[Path]:
    drive = folder / "2011_09_26" / "2011_09_26_drive_0001_sync"
    numbers = "".join(f"{name}: {_ROWS[name]}\n" for name in ("R", "T"))
    _write(drive.parent / "calib_velo_to_cam.txt", numbers)
    _write(drive.parent / "calib_imu_to_velo.txt", numbers)
    rows = {"S_rect_00": "32 24", "R_rect_00": _ROWS["R"], "P_rect_00": _ROWS["P"]}
    cameras = "".join(f"{name}: {row}\n" for name, row in rows.items())
    _write(drive.parent / "calib_cam_to_cam.txt", cameras)
    times = "".join(f"2011-09-26 13:02:2{number}.123456789\n" for number in range(4))
    for part in ("oxts", "image_00", "velodyne_points"):
        _write(drive / part / "timestamps.txt", times)
    for number in range(4):
        oxts = [49.0 + number * 1e-5, 8.4, 112.0, *[0.01] * 22, 4, 10, 4, 4, 4]
        _write(drive / f"oxts/data/{number:010d}.txt", " ".join(map(str, oxts)))
        _sensors(drive / "image_00/data", drive / "velodyne_points/data", f"{number:010d}")
    return [drive.parent]


def _sequences(folder: Path) -> list[Path]:
    sequence = folder / "dataset/sequences/04"
    _write(sequence / "times.txt", "".join(f"{number / 10:e}\n" for number in range(4)))
    _write(sequence / "calib.txt", f"P0: {_ROWS['P']}\nTr: {_ROWS['P']}\n")
    _write(folder / "dataset/poses/04.txt", f"{_ROWS['P']}\n" * 4)
    for number in range(4):
        _sensors(sequence / "image_0", sequence / "velodyne", f"{number:06d}")
    return [folder / "dataset"]


_ROWS = {"R": "1 0 0 0 1 0 0 0 1", "T": "0.1 0.2 0.3", "P": "30 0 16 0 0 30 12 0 0 0 1 0"}


def _sensors(images: Path, scans: Path, name: str) -> None:
    for folder in (images, scans):
        folder.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(images / f"{name}.png"), np.full((24, 32), 90, np.uint8))
    np.ones((50, 4), np.float32).tofile(scans / f"{name}.bin")


def _texts(name: str, text: str) -> Callable[[Path], list[Path]]:
    def make_one(folder: Path) -> list[Path]:
        _write(folder / name, text)
        return [folder / name]

    return make_one


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def _flights(folder: Path) -> list[Path]:
    """A flight log of 40 positions and fixes."""

    def record(kind: str, body: bytes) -> bytes:
        return struct.pack("<HB", len(body), ord(kind)) + body

    parts = [b"ULog\x01\x12\x35\x01" + bytes(8), record("B", bytes(40))]
    for number, (name, fields) in enumerate(_UORB.items()):
        parts.append(record("F", f"{name}:uint64_t timestamp;{fields}".encode()))
        parts.append(record("A", struct.pack("<BH", 0, number) + name.encode()))
    for step in range(40):
        stamp_us = 1_000_000 + 100_000 * step
        attitude = struct.pack("<HQ4f", 0, stamp_us, 1, 0, 0, 0)
        position = struct.pack("<HQ3f2B", 1, stamp_us, step, 0.0, -1.0, 1, 1)
        fix = struct.pack("<HQ3iB", 2, stamp_us, 471000000 + step, 85000000, 400000, 3)
        parts += [record("D", body) for body in (attitude, position, fix)]
        parts += [record("S", _SYNC)] if step % 10 == 0 else []
    path = folder / "made.ulg"
    path.write_bytes(b"".join(parts))
    return [path]


_UORB = {
    "vehicle_attitude": "float[4] q;",
    "vehicle_local_position": "float x;float y;float z;bool xy_valid;bool z_valid;",
    "sensor_gps": "int32_t lat;int32_t lon;int32_t alt;uint8_t fix_type;",
}
_SYNC = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"


def _telemetry(folder: Path) -> list[Path]:
    """A packet of the telemetry of a GoPro film."""

    def item(key: bytes, kind: bytes, size: int, data: bytes) -> bytes:
        head = struct.pack(">4scBH", key, kind, size, len(data) // size)
        return head + data + bytes(-len(data) % 4)

    place = struct.pack(">5l", 471000000, 85000000, 400000, 100, 100)
    scale = struct.pack(">5l", 10_000_000, 10_000_000, 1000, 1000, 100)
    fixes = item(b"SCAL", b"l", 4, scale) + item(b"GPS5", b"l", 20, place * 18)
    turns = [item(key, b"s", 6, struct.pack(">3h", 1, 2, 3) * 50) for key in (b"ACCL", b"GYRO")]
    streams = [item(b"STRM", b"\0", 1, part) for part in (fixes, *turns)]
    path = folder / "packet.gpmf"
    path.write_bytes(item(b"DEVC", b"\0", 1, b"".join(streams)))
    return [path]


_SUBTITLES = "".join(
    f"{n}\n00:00:0{n},000 --> 00:00:0{n + 1},000\nGPS(8.{n},47.1,12) BAROMETER:1{n}.0\n\n"
    for n in range(1, 8)
)
_CALIBRATION = """image_width: 32
image_height: 24
camera_name: made
camera_matrix: {rows: 3, cols: 3, data: [30, 0, 16, 0, 30, 12, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
projection_matrix: {rows: 3, cols: 4, data: [30, 0, 16, 0, 0, 30, 12, 0, 0, 0, 1, 0]}
"""

_MAKERS = {
    "bag": _bags,
    "mcap": _mcaps,
    "mcap_folder": _folder(StoragePlugin.MCAP),
    "db3": _folder(StoragePlugin.SQLITE3),
    "video": _videos,
    "kitti": _drives,
    "kitti_odometry": _sequences,
    "ulg": _flights,
    "gpmf": _telemetry,
    "page": whole_messages,
    "srt": _texts("DJI_0001.SRT", _SUBTITLES),
    "params": _texts(
        "params.yaml", "fps_control: {fps: 10}\nfilters:\n  gray: true\n  threshold: 90\n"
    ),
    "mission": _texts("mission.yaml", "waypoints: [[0, 0, 3], [1, 0, 3, 90]]\nspeed: 1.5\n"),
    "calibration": _texts("camera.yaml", _CALIBRATION),
}

"""ROS 1 bags that tests write, and where in them everything stands."""

import bz2
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import lz4.frame
import numpy as np
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS1_NOETIC)
START_NS = 1_600_000_000_000_000_000
PERIOD_NS = 10_000_000
SIZE = (32, 24)
T = STORE.types


class Written(NamedTuple):
    topic: str
    stamp_ns: int
    data: bytes


class Piece(NamedTuple):
    """A record: what it is, where it begins, where its data does, and where it ends."""

    op: int
    start: int
    data: int
    end: int


@dataclass
class BagWriter:
    """Writes messages and remembers them; chunks are closed at about ``chunk_size`` bytes."""

    path: Path
    compression: str = "none"
    chunk_size: int = 4096
    messages: list[Written] = field(default_factory=list)

    def __enter__(self):
        self.bag = Writer(self.path)
        if self.compression != "none":
            self.bag.set_compression(Writer.CompressionFormat[self.compression.upper()])
        self.bag.chunk_threshold = self.chunk_size
        self.bag.open()
        self.connections = {}
        return self

    def __exit__(self, *error):
        self.bag.close()

    def connect(self, key, topic, type_name, **said):
        self.connections[key] = self.bag.add_connection(
            topic, type_name, **({"typestore": STORE} | said)
        )

    def write(self, key, stamp_ns, message):
        """A message object, or its bytes."""
        connection = self.connections[key]
        if not isinstance(message, bytes):
            message = bytes(STORE.serialize_ros1(message, connection.msgtype))
        self.bag.write(connection, stamp_ns, message)
        self.messages.append(Written(connection.topic, stamp_ns, message))


def header(stamp_ns, frame_id="base_link"):
    time = T["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 10**9))
    return T["std_msgs/msg/Header"](0, time, frame_id)


def image(stamp_ns, value=0):
    """An rgb8 image whose pixels count up from ``value``."""
    width, height = SIZE
    pixels = np.arange(value, value + width * height * 3, dtype=np.uint64).astype(np.uint8)
    kind = T["sensor_msgs/msg/Image"]
    return kind(header(stamp_ns, "camera"), height, width, "rgb8", 0, width * 3, pixels)


def camera_info(stamp_ns, focal_length=30.0):
    width, height = SIZE
    region = T["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    k = np.array([focal_length, 0, 16, 0, focal_length, 12, 0, 0, 1.0])
    p = np.insert(k, [3, 6, 9], 0.0)
    kind = T["sensor_msgs/msg/CameraInfo"]
    head = header(stamp_ns, "camera")
    return kind(
        head, height, width, "plumb_bob", np.zeros(5), k, np.eye(3).ravel(), p, 0, 0, region
    )


def imu(stamp_ns, value=0.0):
    vector = T["geometry_msgs/msg/Vector3"](value, 0.0, 9.81)
    turn = T["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    none = np.zeros(9)
    kind = T["sensor_msgs/msg/Imu"]
    return kind(header(stamp_ns, "imu"), turn, none, vector, none, vector, none)


def cloud(stamp_ns, points=20):
    fields = [
        T["sensor_msgs/msg/PointField"](name, 4 * number, 7, 1) for number, name in enumerate("xyz")
    ]
    data = np.arange(points * 3, dtype=np.float32).view(np.uint8)
    kind = T["sensor_msgs/msg/PointCloud2"]
    head = header(stamp_ns, "lidar")
    return kind(head, 1, points, fields, False, 12, 12 * points, data, True)


def drive(path, compression="none", steps=20, chunk_size=4096):
    """A camera, its calibration, an IMU and a lidar, in several chunks; what was written."""
    with BagWriter(path, compression, chunk_size) as bag:
        bag.connect("image", "/cam/image_raw", "sensor_msgs/msg/Image")
        bag.connect("info", "/cam/camera_info", "sensor_msgs/msg/CameraInfo")
        bag.connect("imu", "/imu", "sensor_msgs/msg/Imu")
        bag.connect("cloud", "/points", "sensor_msgs/msg/PointCloud2")
        for step in range(steps):
            now_ns = START_NS + step * PERIOD_NS
            bag.write("info", now_ns, camera_info(now_ns))
            bag.write("image", now_ns, image(now_ns, step))
            for part in range(3):
                bag.write("imu", now_ns + part * 1_000_000, imu(now_ns, float(step)))
            bag.write("cloud", now_ns + 5_000_000, cloud(now_ns))
    return bag.messages


def contents(recording, *window, **choice):
    """What a recording gives, in the form of what was written."""
    return [
        Written(entry.topic, entry.stamp_ns, bytes(entry.message.data))
        for entry in recording.read(*window, **choice)
    ]


def pieces(data, start=13, end=None):
    """The records of a whole bag's bytes, or of a chunk's content."""
    found = []
    end = len(data) if end is None else end
    while start < end:
        (header_size,) = struct.unpack_from("<I", data, start)
        fields = data[start + 4 : start + 4 + header_size]
        op = fields[fields.index(b"op=") + 3]
        (data_size,) = struct.unpack_from("<I", data, start + 4 + header_size)
        first = start + 8 + header_size
        found.append(Piece(op, start, first, first + data_size))
        start = first + data_size
    return found


def chunks(data):
    """The records that are chunks."""
    return [piece for piece in pieces(data) if piece.op == 5]


def message_counts(data):
    """How many messages each chunk has, by the index records behind it."""
    counts = []
    for piece in pieces(data):
        if piece.op == 5:
            counts.append(0)
        elif piece.op == 4:
            counts[-1] += (piece.end - piece.data) // 12
    return counts


def by_definition(data):
    """All messages of a whole bag in the order of the file, read as the format describes it."""
    decompress = {b"none": bytes, b"bz2": bz2.decompress, b"lz4": lz4.frame.decompress}
    topics, messages = {}, []
    for chunk in chunks(data):
        compression = said(data, chunk)[b"compression"]
        content = decompress[compression](data[chunk.data : chunk.end])
        for piece in pieces(content, 0):
            fields = said(content, piece)
            if piece.op == 7:
                topics[fields[b"conn"]] = "/" + fields[b"topic"].decode().lstrip("/")
            else:
                sec, nanosec = struct.unpack("<II", fields[b"time"])
                message = content[piece.data : piece.end]
                stamp_ns = sec * 10**9 + nanosec
                messages.append(Written(topics[fields[b"conn"]], stamp_ns, message))
    return messages


def said(data, piece):
    """The fields of a record's header."""
    fields, start = {}, piece.start + 4
    while start < piece.data - 4:
        (size,) = struct.unpack_from("<I", data, start)
        name, _, value = data[start + 4 : start + 4 + size].partition(b"=")
        fields[name] = value
        start += 4 + size
    return fields


def without_index(data):
    """The bag as it is left when it is not closed: nothing behind the chunks and their indexes."""
    end = next(piece.start for piece in pieces(data) if piece.op in (6, 7))
    return set_index_position(data[:end], 0)


def set_index_position(data, position):
    place = data.index(b"index_pos=") + len(b"index_pos=")
    return data[:place] + struct.pack("<Q", position) + data[place + 8 :]

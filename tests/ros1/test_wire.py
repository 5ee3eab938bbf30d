"""What goes over the wire, byte by byte, and the buffers that it comes in."""

import copy
import gc
import socket
import struct
import threading
from io import BytesIO
from typing import Any

import cv2
import genpy
import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry, Path
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2, PointField
from std_msgs.msg import Empty, Header

from ros_visualise import messages
from ros_visualise.data import Image as OurImage
from ros_visualise.runtime.memory import BufferPool
from ros_visualise.runtime.ros1.receiver import BrokenStream, Stream
from ros_visualise.runtime.ros1.wire import as_bytes, decode, encode, is_large

HEADER = Header(7, genpy.Time(1_700_000_000, 9), "camera_ß")
FIELDS = [PointField("x", 0, PointField.FLOAT32, 1), PointField("intensity", 4, 7, 1)]
LARGE = [
    Image(HEADER, 2, 3, "mono16", 0, 6, bytes(range(12))),
    Image(HEADER, 0, 0, "", 0, 0, b""),
    CompressedImage(HEADER, "jpeg", bytes(range(200))),
    CompressedImage(Header(), "", b""),
    PointCloud2(HEADER, 1, 3, FIELDS, False, 8, 24, bytes(range(24)), True),
    PointCloud2(HEADER, 0, 0, [], False, 8, 0, b"", False),
]
SMALL = [
    Path(HEADER, [PoseStamped(), PoseStamped(header=HEADER)]),
    Odometry(header=HEADER, child_frame_id="base"),
    CameraInfo(header=HEADER, D=[1.0, 2.0]),
    HEADER,
    Empty(),
]


def serialize(message: Any) -> bytes:
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def join(message: Any, seq: int | None = None) -> bytes:
    header = getattr(message, "header", Header())
    parcel = encode(message, header.seq if seq is None else seq)
    raw = b"".join(parcel.buffers)
    assert len(raw) == parcel.size
    return raw


def body_of(raw: bytes) -> Any:
    return np.frombuffer(bytearray(raw), np.uint8)


def kind(message: Any) -> str:
    return f"{type(message).__name__}-{len(getattr(message, 'data', b''))}"


@pytest.mark.parametrize("message", LARGE + SMALL, ids=kind)
def test_the_bytes_are_those_of_genpy(message):
    raw = serialize(message)
    assert join(message) == struct.pack("<I", len(raw)) + raw


@pytest.mark.parametrize("message", LARGE + SMALL, ids=kind)
def test_messages_come_back(message):
    body = body_of(serialize(message))
    found = decode(body, type(message))
    if is_large(message):
        assert type(found.data) is np.ndarray
        assert np.shares_memory(found.data, body) == bool(found.data.size)
        found.data = found.data.tobytes()
    assert found == message


def test_the_header_is_numbered():
    message = copy.deepcopy(LARGE[0])
    assert decode(body_of(join(message, 41)[4:]), Image).header.seq == 41


BYTES = bytes(range(12))
PIXELS = np.frombuffer(BYTES, np.uint8)


@pytest.mark.parametrize(
    "data",
    [
        BYTES,
        bytearray(BYTES),
        memoryview(BYTES),
        list(BYTES),
        tuple(BYTES),
        PIXELS,
        PIXELS.reshape(2, 2, 3),
        PIXELS.view("<u2").reshape(2, 3),
        PIXELS.view(">u2"),
        PIXELS.view(np.float32),
    ],
    ids=lambda data: f"{type(data).__name__}-{getattr(data, 'shape', '')}",
)
def test_any_buffer_of_bytes_is_taken(data):
    assert join(Image(HEADER, 2, 3, "mono16", 0, 6, data)) == join(LARGE[0])


@pytest.mark.parametrize("shape", [(0,), (0, 4), (5, 0, 3)])
def test_no_pixels_are_pixels(shape):
    assert join(Image(HEADER, 0, 0, "", 0, 0, np.empty(shape, np.uint8))) == join(LARGE[1])


def test_data_is_not_copied():
    pixels = np.zeros((4, 5, 3), np.uint8)
    parcel = encode(Image(data=pixels), 1)
    assert any(np.shares_memory(np.asarray(one), pixels) for one in parcel.buffers)


@pytest.mark.parametrize("data", [5, "text", [300], [-1], [1.5], PIXELS[::2]])
def test_what_is_no_buffer_is_refused(data):
    with pytest.raises(genpy.SerializationError, match="not a buffer of bytes"):
        encode(Image(data=data), 1)
    with pytest.raises(genpy.SerializationError):
        as_bytes(data)


@pytest.mark.parametrize("message", [Image(height=-1), Image(encoding=5), Odometry(header=HEADER)])
def test_a_wrong_field_is_refused(message):
    if isinstance(message, Odometry):
        message.pose.covariance = [1.0]
    with pytest.raises(genpy.SerializationError):
        encode(message, 1)


@pytest.mark.parametrize("message", LARGE + SMALL[:3], ids=kind)
def test_a_truncated_message_is_refused(message):
    raw = serialize(message)
    for end in range(len(raw)):
        with pytest.raises(genpy.DeserializationError):
            decode(body_of(raw[:end]), type(message))


@pytest.mark.parametrize("message", LARGE + SMALL[:3], ids=kind)
@pytest.mark.parametrize("length", [2**32 - 1, 2**31, 10**6])
def test_lengths_that_contradict_do_no_harm(message, length):
    raw = serialize(message)
    refused = 0
    for place in range(len(raw) - 4):
        wrong = raw[:place] + struct.pack("<I", length) + raw[place + 4 :]
        try:
            found = decode(body_of(wrong), type(message))
            assert len(getattr(found, "data", b"")) <= len(raw)
        except genpy.DeserializationError:
            refused += 1
    assert refused


def test_data_shorter_than_what_is_left_is_refused():
    raw = serialize(LARGE[0])
    with pytest.raises(genpy.DeserializationError, match="announced"):
        decode(body_of(raw + b"12345"), Image)


@pytest.fixture
def pair():
    here, there = socket.socketpair()
    yield here, there
    here.close()
    there.close()


def test_messages_are_received_in_whatever_pieces(pair):
    raw = join(LARGE[0]) + join(LARGE[2]) + join(Empty())

    def send():
        for i in range(len(raw)):
            pair[0].send(raw[i : i + 1])

    thread = threading.Thread(target=send)
    thread.start()
    stream = Stream(pair[1])
    received = [stream.receive() for _ in range(3)]
    thread.join()
    assert b"".join(struct.pack("<I", len(one)) + one.tobytes() for one in received) == raw


@pytest.mark.parametrize("end", [0, 2, 4, 30])
def test_an_end_in_the_middle_is_an_end(pair, end):
    pair[0].sendall(join(LARGE[2])[:end])
    pair[0].close()
    with pytest.raises(EOFError):
        Stream(pair[1]).receive()


@pytest.mark.parametrize("count", range(0, 500, 7))
def test_what_came_with_the_handshake_comes_first(pair, count):
    raw = join(Empty()) + join(LARGE[2]) + join(LARGE[0])
    pair[0].sendall(raw[count:])
    stream = Stream(pair[1], raw[:count])
    received = [stream.receive() for _ in range(3)]
    assert b"".join(struct.pack("<I", len(one)) + one.tobytes() for one in received) == raw


def test_an_absurd_length_is_refused_before_anything_is_kept_for_it(pair, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(BufferPool, "take", no_memory)
        pair[0].sendall(b"GET ")
        with pytest.raises(BrokenStream, match="no memory for a message of 542393671 bytes"):
            Stream(pair[1]).receive()
    pair[0].sendall(b"\xff\xff\xff\xff")
    with pytest.raises(BrokenStream, match="4294967295 bytes"):
        Stream(pair[1]).receive()


def no_memory(pool: BufferPool, size: int) -> Any:
    raise MemoryError


HOLDERS = {
    "itself": lambda body: body,
    "a slice": lambda body: body[3:5],
    "a view of another type": lambda body: body[:8].view("<u4").reshape(2, 1)[::2].T,
    "a memoryview": memoryview,
    "a slice of a memoryview": lambda body: memoryview(body)[1:2].cast("b"),
    "a buffer of it": lambda body: np.frombuffer(memoryview(body)[4:], np.int16),
    "one element's view": lambda body: body[5:6].reshape(()),
    "an iterator": iter,
    "a message": lambda body: Image(data=body[2:]),
    "an image": lambda body: image_of(body),
    "the pixels of an image": lambda body: image_of(body).pixels,
    "what OpenCV drew on": lambda body: cv2.circle(body[:900].reshape(30, 30), (9, 9), 3, 1),
}


def image_of(body: Any) -> OurImage:
    message = Image(HEADER, 2, 3, "bgr8", 0, 9, body[:18])
    image = messages.from_message(message, OurImage)
    assert np.shares_memory(image.pixels, body)
    return image


@pytest.mark.parametrize("hold", HOLDERS.values(), ids=HOLDERS)
def test_a_buffer_is_not_used_anew_while_anybody_holds_anything_of_it(hold):
    pool = BufferPool()
    body = pool.take(1000)
    address = body.ctypes.data
    holder = hold(body)
    del body
    for _ in range(20):
        assert pool.take(1000).ctypes.data != address
    del holder
    gc.collect()
    assert address in {body.ctypes.data for body in [pool.take(1000) for _ in range(4)]}


def test_a_buffer_held_in_another_thread_stays_as_it_was():
    pool = BufferPool()
    body = pool.take(1000)
    body[:] = 7
    checked, let_go = threading.Event(), threading.Event()
    found: list[int] = []

    def work(view: Any) -> None:
        checked.wait(10)
        found.append(int(view.sum()))
        del view
        let_go.set()

    thread = threading.Thread(target=work, args=(body[10:20],))
    thread.start()
    del body
    for _ in range(10):
        pool.take(1000)[:] = 0
    checked.set()
    thread.join(10)
    assert found == [70]


def test_a_single_buffer_serves_who_lets_go():
    pool = BufferPool()
    assert len({pool.take(1000).ctypes.data for _ in range(50)}) == 1
    assert len(pool.take(900)) == 900


def test_what_was_held_comes_back_and_the_rest_goes():
    pool = BufferPool()
    held = [pool.take(1000) for _ in range(10)]
    addresses = {body.ctypes.data for body in held}
    assert len(addresses) == 10
    held.clear()
    again = [pool.take(1000) for _ in range(3)]
    assert {body.ctypes.data for body in again} <= addresses
    again.clear()
    pool.take(1000)
    assert len(pool._buffers) <= 3


def test_another_size_drives_out_the_old_one():
    pool = BufferPool()
    held = [pool.take(1000) for _ in range(3)]
    held.clear()
    assert len({pool.take(5000).ctypes.data for _ in range(9)}) == 1
    assert [buffer.nbytes for buffer in pool._buffers] == [5000]
    assert len(pool.take(0)) == 0


def test_somebody_who_keeps_everything_does_not_make_the_pool_keep_it():
    pool = BufferPool()
    held = [pool.take(100) for _ in range(200)]
    assert len({body.ctypes.data for body in held}) == 200
    assert len(pool._buffers) < 50

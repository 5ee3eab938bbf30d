"""Live topics: from foxglove-sdk's server, and from a rosbridge that its specification describes.

Messages of the servers are written by rosbags and cbor2, not by our own code.
"""

import base64
import json
import struct
import threading
from contextlib import closing, contextmanager
from functools import partial

import cbor2
import foxglove
import numpy as np
import pytest
from foxglove.websocket import Capability, ServerListener
from rosbags.typesys import Stores, get_typestore
from waiting import wait_for
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve

from ros_visualise.commands import main
from ros_visualise.core.errors import DamagedMessage, OpenError, Unreachable
from ros_visualise.graph.pipelines import server_pipeline
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import Recorded
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback
from ros_visualise.sources.servers import connection as connecting
from ros_visualise.sources.servers.connection import Connection

ROS2, ROS1 = get_typestore(Stores.ROS2_JAZZY), get_typestore(Stores.ROS1_NOETIC)
POINT, TWIST = "geometry_msgs/msg/Point", "geometry_msgs/msg/Twist"


def point(x, y=0.0, z=0.0):
    return ROS2.types[POINT](x, y, z)


def twist(speed):
    vector = ROS2.types["geometry_msgs/msg/Vector3"]
    message = ROS2.types[TWIST](vector(speed, 0.0, 0.0), vector(0.0, 0.0, 0.0))
    data = bytes(ROS2.serialize_cdr(message, TWIST))
    return Recorded(TWIST, data, Definitions("cdr"), 0)


def take(connection, count):
    """Topics and decoded ROS messages."""
    found = []
    for one in connection.messages():
        if one is not None:
            found.append((one.topic, one.message.message))
        if len(found) == count:
            return found
    raise AssertionError("the connection was closed")


class Published(ServerListener):
    def __init__(self):
        self.channels, self.data = [], []

    def on_client_advertise(self, client, channel):
        self.channels.append(channel)

    def on_message_data(self, client, client_channel_id, data):
        self.data.append(bytes(data))


def channel(context, topic, type_name, encoding="cdr"):
    text, _ = ROS2.generate_msgdef(type_name, ros_version=2)
    schema = foxglove.Schema(name=type_name, encoding="ros2msg", data=text.encode())
    return foxglove.Channel(topic, message_encoding=encoding, schema=schema, context=context)


@pytest.fixture
def sdk():
    """foxglove-sdk's server, its context, and what clients publish."""
    context, heard = foxglove.Context(), Published()
    server = foxglove.start_server(
        host="127.0.0.1",
        port=0,
        context=context,
        capabilities=[Capability.ClientPublish],
        supported_encodings=["cdr"],
        server_listener=heard,
    )
    yield f"ws://127.0.0.1:{server.port}", context, heard
    server.stop()


def test_messages_of_an_independent_foxglove_server(sdk):
    address, context, _ = sdk
    odometry = channel(context, "/point", POINT)
    foxglove.Channel("/notes", message_encoding="json", context=context)
    with closing(Connection(address)) as connection:
        assert "only ROS messages" in connection.channels["/notes"].unreadable
        connection.start(["/point"])
        wait_for(odometry.has_sinks)
        for x in range(5):
            odometry.log(bytes(ROS2.serialize_cdr(point(float(x)), POINT)), log_time=10**18 + x)
        received = take_raw(connection, 5)
    assert [one.message.message.x for one in received] == [0, 1, 2, 3, 4]
    assert [one.message.stamp_ns for one in received] == [10**18 + x for x in range(5)]


def take_raw(connection, count):
    found = []
    for one in connection.messages():
        found += [one] if one is not None else []
        if len(found) == count:
            return found
    raise AssertionError("the connection was closed")


def test_a_message_published_at_a_foxglove_server(sdk):
    address, context, heard = sdk
    channel(context, "/point", POINT)
    with closing(Connection(address)) as connection:
        connection.start([])
        connection.publish("/cmd", twist(0.5))
        wait_for(lambda: heard.data)
    [data], [advertised] = heard.data, heard.channels
    found = ROS2.deserialize_cdr(data, TWIST)
    assert (advertised.topic, found.linear.x, found.angular.z) == ("/cmd", 0.5, 0.0)


@contextmanager
def serving(handle, port=0):
    """A WebSocket server of ours, which closes its connections at its end; its address."""
    sockets = []

    def keep(socket):
        sockets.append(socket)
        handle(socket)

    how = {"compression": None, "max_size": None, "max_queue": 1, "close_timeout": 0.1}
    with serve(keep, "127.0.0.1", port, **how) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}"
        finally:
            server.shutdown()
            thread.join()
            for socket in sockets:
                socket.close()


class Rosbridge:
    """A rosbridge with one topic, whose messages ``answers`` makes: frames for each request."""

    def __init__(self, answers, types=("sensor_msgs/msg/Image",), texts=None, listing=True):
        self.answers, self.types, self.texts, self.listing = answers, types, texts, listing
        self.heard = []

    def __call__(self, socket):
        try:
            for frame in socket:
                request = json.loads(frame)
                self.heard.append(request)
                for answer in self._answers(request):
                    socket.send(answer)
        except ConnectionClosed:
            pass

    def _answers(self, request):
        if request["op"] == "subscribe":
            return self.answers
        if request["op"] != "call_service":
            return []
        topics = [f"/topic{i}" for i in range(len(self.types))]
        values = {"topics": topics, "types": list(self.types)}
        if request["service"].endswith("raw_types"):
            values["typedefs_full_text"] = list(self.texts or [""] * len(topics))
            if self.texts is None:
                return [response(request, "no such service", False)]
        return [response(request, values if self.listing else "no such service", self.listing)]


def response(request, values, result):
    return json.dumps(
        {
            "op": "service_response",
            "id": request["id"],
            "service": request["service"],
            "values": values,
            "result": result,
        }
    )


def publishing(msg):
    return {"op": "publish", "topic": "/topic0", "msg": msg}


def image(data, stamp):
    header = {"stamp": stamp, "frame_id": "camera"}
    size = {"height": 2, "width": 3, "step": 3, "encoding": "mono8", "is_bigendian": 0}
    return {"header": header, **size, "data": data}


PIXELS = bytes(range(6))


@pytest.mark.parametrize(
    ("frame", "types"),
    [
        (
            json.dumps(
                publishing(image(base64.b64encode(PIXELS).decode(), {"sec": 7, "nanosec": 8}))
            ),
            ["sensor_msgs/msg/Image"],
        ),
        (
            cbor2.dumps(publishing(image(PIXELS, {"secs": 7, "nsecs": 8}))),
            ["sensor_msgs/Image"],
        ),
    ],
    ids=["json of ROS 2", "cbor of ROS 1"],
)
def test_an_image_of_a_rosbridge(frame, types):
    server = Rosbridge([frame], types)
    with serving(server) as address, closing(Connection(address)) as connection:
        connection.start(["/topic0"])
        [received] = take_raw(connection, 1)
    found = received.message.content
    assert found.header.stamp_ns == 7_000_000_008
    assert found.pixels.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert server.heard[-1] == {
        "op": "subscribe",
        "topic": "/topic0",
        "type": types[0],
        "compression": "cbor",
    }


def test_messages_come_as_bytes_where_the_server_defines_its_types():
    data = bytes(ROS2.serialize_cdr(point(5.0), POINT))
    frames = [
        cbor2.dumps(publishing({"secs": 1, "nsecs": 2, "bytes": data})),
        cbor2.dumps(publishing({"secs": 1, "nsecs": 2, "bytes": data[:9]})),
        json.dumps(publishing({"x": 6})),  # a server that does not know that compression
    ]
    server = Rosbridge(frames, [POINT], ["float64 x\nfloat64 y\nfloat64 z"])
    with serving(server) as address, closing(Connection(address)) as connection:
        connection.start(["/topic0"])
        whole, cut, plain = (one.message for one in take_raw(connection, 3))
    assert (whole.message.x, plain.message.x) == (5, 6)
    with pytest.raises(DamagedMessage):
        cut.message  # noqa: B018
    assert server.heard[-1]["compression"] == "cbor-raw"


@pytest.mark.parametrize(
    "type_name", ["nav_msgs/msg/Odometry", "rcl_interfaces/msg/ParameterEvent"]
)
def test_json_is_asked_for_where_rosbridge_fails_in_cbor(type_name):
    server = Rosbridge([], [type_name])
    with serving(server) as address, closing(Connection(address)) as connection:
        connection.start(["/topic0"])
        wait_for(lambda: server.heard[-1].get("compression") == "none")


def test_arrays_of_cbor_and_types_that_only_the_server_defines():
    ranges = cbor2.CBORTag(85, np.array([1, np.inf, np.nan], "<f4").tobytes())
    frame = cbor2.dumps(publishing({"ranges": ranges, "name": "left", "flags": [True, False]}))
    text = "float32[] ranges\nstring name\nbool[2] flags\nsensor_msgs/Temperature heat"
    server = Rosbridge([frame], ["my_msgs/msg/Scan"], [text])
    with serving(server) as address, closing(Connection(address)) as connection:
        connection.start(["/topic0"])
        [(_, found)] = take(connection, 1)
    assert np.array_equal(found.ranges, [1, np.inf, np.nan], equal_nan=True)
    assert (found.name, found.flags.tolist(), found.heat.variance) == ("left", [True, False], 0)


def test_messages_published_at_a_rosbridge():
    server = Rosbridge([], ["geometry_msgs/Twist"])
    with serving(server) as address, closing(Connection(address)) as connection:
        connection.start([])
        for speed in (1.0, 2.0):
            connection.publish("/topic0", twist(speed))
        with pytest.raises(DamagedMessage, match="/topic0 is of type geometry_msgs/msg/Twist"):
            connection.publish("/topic0", Recorded(POINT, b"", Definitions("cdr"), 0))
        wait_for(lambda: len(server.heard) >= 5)
    zero = {"y": 0.0, "z": 0.0}
    sent = [(one["op"], one.get("type", one.get("msg"))) for one in server.heard[2:]]
    assert sent == [
        ("advertise", "geometry_msgs/Twist"),
        ("publish", {"linear": {"x": 1.0, **zero}, "angular": {"x": 0.0, **zero}}),
        ("publish", {"linear": {"x": 2.0, **zero}, "angular": {"x": 0.0, **zero}}),
    ]


GOOD = cbor2.dumps({"op": "publish", "topic": "/topic0", "msg": {"x": 4}})
HOSTILE = [
    "{",
    "[" * 100_000,
    "7",
    json.dumps({"op": "publish", "topic": "/topic0"}),
    json.dumps({"op": "publish", "topic": "/topic0", "msg": {"x": "1"}}),
    json.dumps({"op": "publish", "topic": "/topic0", "msg": {"w": 1}}),
    json.dumps({"op": "publish", "topic": "/topic0", "msg": {"x": 10**400}}),
    b"",
    b"\x81" * 100_000,
    b"\x9b" + b"\xff" * 8,
    b"\x5b\x7f" + b"\xff" * 7,
    cbor2.dumps({"op": "publish", "topic": "/topic0", "msg": {"x": cbor2.CBORTag(85, b"123")}}),
]


def test_malformed_messages_are_counted_and_those_after_them_come(caplog):
    server = Rosbridge([*HOSTILE, GOOD], [POINT])
    with serving(server) as address, closing(Connection(address)) as connection:
        connection.start(["/topic0"])
        assert take(connection, 1) == [("/topic0", point(4.0))]
        assert connection.report() == {"damaged": len(HOSTILE)}
    assert sum("point.x" in one or "x: must be" in one for one in caplog.messages) <= 3


def test_a_flood_drops_the_oldest_and_counts_them(monkeypatch):
    monkeypatch.setattr(connecting, "_MOST_WAITING", 10)
    frames = [json.dumps(publishing({"x": x})) for x in range(1000)]
    server = Rosbridge(frames, [POINT])
    with serving(server) as address, closing(Connection(address)) as connection:
        connection.start(["/topic0"])
        wait_for(lambda: connection.report().get("queue") == 990)
        assert [one.x for _, one in take(connection, 10)] == list(range(990, 1000))


def test_a_frame_that_is_too_large_is_said_once(caplog, monkeypatch):
    monkeypatch.setattr(connecting, "_BACK_OFF_S", (0.01, 0.02))
    monkeypatch.setattr(connecting, "unpacked_limit", lambda _: 10_000)
    server = Rosbridge([b"x" * 20_000], [POINT])
    with serving(server) as address, closing(Connection(address)) as connection:
        connection.start(["/topic0"])
        wait_for(lambda: sum(one["op"] == "subscribe" for one in server.heard) > 2)
    assert sum("--max-memory" in one for one in caplog.messages) == 1


def test_a_server_that_ends_and_comes_back(caplog, monkeypatch):
    monkeypatch.setattr(connecting, "_BACK_OFF_S", (0.01, 0.02))
    caplog.set_level("INFO")
    server = Rosbridge([GOOD], [POINT])
    with serving(server) as address:
        connection = Connection(address)
        connection.start(["/topic0"])
        take(connection, 1)
    with closing(connection):
        wait_for(lambda: any("trying again" in one for one in caplog.messages))
        with pytest.raises(Unreachable):
            connection.publish("/topic0", twist(1.0))
        with serving(server, int(address.rpartition(":")[2])):
            assert take(connection, 1) == [("/topic0", point(4.0))]
            wait_for(lambda: any("connection restored" in one for one in caplog.messages))
            assert sum("trying again" in one for one in caplog.messages) == 1


def test_a_server_that_reads_nothing_blocks_nobody(monkeypatch):
    monkeypatch.setattr(connecting, "_SEND_S", 1)
    is_over = threading.Event()

    class Deaf(Rosbridge):
        def __call__(self, socket):
            for _ in range(2):
                for answer in self._answers(json.loads(socket.recv())):
                    socket.send(answer)
            is_over.wait(60)

    large = ROS2.types["std_msgs/msg/String"]("x" * 5_000_000)
    data = bytes(ROS2.serialize_cdr(large, "std_msgs/msg/String"))
    message = Recorded("std_msgs/msg/String", data, Definitions("cdr"), 0)
    with serving(Deaf([], ["std_msgs/msg/String"])) as address:
        with closing(Connection(address)) as connection:
            connection.start([])
            publish = partial(connection.publish, "/topic0", message)
            with pytest.raises(Unreachable):
                wait_for(publish)
        is_over.set()


def silent(socket):
    for _ in socket:
        pass


@pytest.mark.parametrize(
    ("handle", "reason"),
    [
        (Rosbridge([], [POINT], listing=False), "no topics"),
        (Rosbridge([], []), "no topics"),
        (lambda socket: socket.close(), "the connection was lost"),
        (silent, "no topics"),
    ],
    ids=["without rosapi", "without topics", "closes", "silent"],
)
def test_servers_that_list_nothing_are_reported(handle, reason, monkeypatch):
    monkeypatch.setattr(connecting, "_LIST_S", 0.5)
    with serving(handle) as address, pytest.raises(OpenError, match=reason):
        Connection(address)


def test_no_server(capsys):
    assert main(["ws://me:secret@127.0.0.1:9", "--view", "none"]) == 2
    error = capsys.readouterr().err
    assert "ws://me:***@127.0.0.1:9: cannot connect" in error
    assert "secret" not in error
    assert main(["ws://127.0.0.1:9", "--loop"]) == 2


def test_a_server_is_a_source_of_a_graph(sdk, tmp_path):
    address, context, _ = sdk
    channel(context, "/image", "sensor_msgs/msg/Image")
    points = channel(context, "/point", POINT)
    graph = server_pipeline(Connection(address))
    assert graph.source.outputs == {"/image": "/image", "/point": "/point"}
    assert graph.nodes[0].inputs["image"] == "/image"
    runtime = LocalRuntime(graph, Playback())
    heard = runtime.subscribe("/point", depth=10)
    runtime.start()
    try:
        wait_for(points.has_sinks)
        points.log(bytes(ROS2.serialize_cdr(point(3.0), POINT)))
        assert heard.take(60).message.x == 3
    finally:
        runtime.stop()


def test_malformed_messages_of_a_foxglove_server():
    frames = [
        json.dumps({"op": "advertise", "channels": [{"id": -1}]}),
        json.dumps({"op": "advertise", "channels": [advert(1, "/bad", "int32 x[")]}),
        json.dumps({"op": "advertise", "channels": [advert(2, "/good", "int32 x")]}),
    ]
    data = [
        b"\1",
        b"\1" + struct.pack("<IQ", 99, 5) + b"unknown channel",
        b"\1" + struct.pack("<IQ", 2, 2**64 - 1) + b"cut",
        b"\1" + struct.pack("<IQ", 2, 5) + b"\0\1\0\0\7\0\0\0",
    ]

    def handle(socket):
        for frame in frames:
            socket.send(frame)
        assert json.loads(socket.recv())["subscriptions"] == [{"id": 2, "channelId": 2}]
        for frame in data:
            socket.send(frame)
        silent(socket)

    def choose(_, offered):
        return next(iter(offered))

    with serve(handle, "127.0.0.1", 0, select_subprotocol=choose) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        port = server.socket.getsockname()[1]
        with closing(Connection(f"ws://127.0.0.1:{port}")) as connection:
            assert "cannot be read" in connection.channels["/bad"].unreadable
            connection.start(["/good"])
            cut, whole = take_raw(connection, 2)
            with pytest.raises(DamagedMessage):
                cut.message.message  # noqa: B018
            assert (whole.message.message.x, whole.message.stamp_ns) == (7, 5)
            assert connection.report() == {"damaged": 2}
        server.shutdown()
        thread.join()


def advert(number, topic, schema):
    names = {"topic": topic, "schemaName": "my_msgs/msg/Number", "schemaEncoding": "ros2msg"}
    return {"id": number, "encoding": "cdr", "schema": schema, **names}

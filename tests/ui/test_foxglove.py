"""The Foxglove WebSocket protocol, from a client that was written from its specification.

Its binary messages are packed here by hand: what the server packs is not judged by its own code.
"""

import json
import struct
import time
from contextlib import closing, contextmanager

import pytest
from page_client import TOKEN, VIEW_TOKEN
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from waiting import wait_for
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from ros_visualise.graph.pipelines import recording_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sinks.encoding import Encoder
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.live.foxglove.queue import ViewerQueue
from ros_visualise.ui.page import Page

NEWER, OLDER = "foxglove.sdk.v1", "foxglove.websocket.v1"
BLOCK = """{n}
00:00:{a:02d},000 --> 00:00:{b:02d},000
HOME(149.0251,-20.2532) 2017.08.05 14:11:51
GPS({x:.4f},-20.2533,16) BAROMETER:1.9

"""


class Viewer:
    """A client: it keeps what comes, JSON by its ``op`` and the rest by its first byte."""

    def __init__(self, port, protocol=NEWER, token=TOKEN, origin=None):
        self.socket = connect(
            f"ws://127.0.0.1:{port}/{token}/foxglove",
            subprotocols=[protocol],
            origin=origin,
            max_size=None,
        )
        self.heard = []

    def send(self, op, **fields):
        self.socket.send(json.dumps({"op": op, **fields}))

    def wait(self, kind, check=lambda message: True):
        """The next message of a kind for which the check holds, whatever of others came before."""
        end_s = time.monotonic() + 60
        while True:
            for number, (known, message) in enumerate(self.heard):
                if known == kind and check(message):
                    older = [one for one in self.heard[:number] if one[0] != kind]
                    self.heard = older + self.heard[number + 1 :]
                    return message
            assert time.monotonic() < end_s, f"no {kind} came"
            self._take()

    def _take(self):
        message = self.socket.recv(timeout=60)
        if isinstance(message, str):
            found = json.loads(message)
            self.heard.append((found["op"], found))
        else:
            self.heard.append((message[0], message))

    def channel(self, topic):
        """The advertised channel of a topic."""
        advert = self.wait("advertise")
        return next(one for one in advert["channels"] if one["topic"] == topic)

    def parameters(self, *names, id="asked"):
        self.send("getParameters", parameterNames=list(names), id=id)
        found = self.wait("parameterValues", lambda one: one.get("id") == id)["parameters"]
        return {one["name"]: one["value"] for one in found}

    def error(self):
        return self.wait("status", lambda one: one["level"] == 2)["message"]


@pytest.fixture
def viewer(page, port):
    connected = Viewer(port)
    with closing(connected.socket):
        yield connected


@contextmanager
def flown(port, folder):
    """A page that plays a flight log of 40 fixes, one a second, from its start; paused."""
    file = folder / "flight.SRT"
    blocks = (BLOCK.format(n=n + 1, a=n, b=n + 1, x=149 + n / 1000) for n in range(40))
    file.write_text("".join(blocks))
    playback = Playback(hold=True)
    playback.pause()
    runtime = LocalRuntime(recording_pipeline(open_recording(file)), playback)
    runtime.start()
    page = Page(ViewOptions(port=port))
    page.open(runtime)
    try:
        yield playback
    finally:
        page.close()
        runtime.stop()


def control(playing, speed, seek_ns, name):
    id = name.encode()
    head = struct.pack("<BBfBQI", 3, not playing, speed, seek_ns is not None, seek_ns or 0, len(id))
    return head + id


def state_of(message):
    status, now_ns, speed, did_seek, length = struct.unpack_from("<BQfBI", message, 1)
    return status, now_ns, speed, did_seek, message[19 : 19 + length].decode()


@pytest.mark.parametrize("protocol", [NEWER, OLDER])
def test_both_protocols_begin_with_what_there_is(page, port, protocol):
    viewer = Viewer(port, protocol)
    assert viewer.socket.subprotocol == protocol
    info = viewer.wait("serverInfo")
    assert {"parameters", "parametersSubscribe", "services", "time"} <= set(info["capabilities"])
    assert ("playbackControl" in info["capabilities"]) == (protocol == NEWER)
    assert viewer.channel("/edges")["schemaName"] == "sensor_msgs/msg/Image"
    viewer.socket.close()


def test_the_gate_holds_for_viewers_too(page, port):
    for given in (
        {"token": "wrong"},
        {"token": TOKEN, "origin": "http://evil.example"},
        {"protocol": "other"},
    ):
        with pytest.raises(InvalidStatus) as refused:
            Viewer(port, **given)
        assert refused.value.response.status_code == (400 if "protocol" in given else 403)


@pytest.mark.parametrize("path", ["", "/", "/nothing"])
def test_a_viewer_at_a_wrong_path_is_answered_with_the_right_one(page, port, caplog, path):
    with pytest.raises(InvalidStatus) as refused:
        connect(f"ws://127.0.0.1:{port}/{TOKEN}{path}", subprotocols=[OLDER])
    assert refused.value.response.status_code == 404
    assert b"and append /foxglove" in refused.value.response.body
    assert "and append /foxglove" in caplog.text


def test_a_desktop_app_may_be_let_in_by_its_origin(port, runtime):
    for origins, status in ([], 403), (["file://"], 101):
        page = Page(ViewOptions(port=port, origins=origins))
        page.open(runtime)
        try:
            viewer = Viewer(port, origin="file://")
            viewer.socket.close()
            found = 101
        except InvalidStatus as refused:
            found = refused.response.status_code
        finally:
            page.close()
        assert found == status


def test_messages_come_in_cdr_with_their_whole_definition(viewer, runtime):
    channel = viewer.channel("/controlled_stream")
    assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
    viewer.send("subscribe", subscriptions=[{"id": 7, "channelId": channel["id"]}])
    message = viewer.wait(1)  # at once, though it is paused
    number, log_ns = struct.unpack_from("<IQ", message, 1)
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(channel["schema"], channel["schemaName"]))
    image = store.deserialize_cdr(message[13:], channel["schemaName"])
    assert (number, image.width, image.height, image.encoding) == (7, 640, 480, "bgr8")
    assert log_ns == image.header.stamp.sec * 10**9 + image.header.stamp.nanosec
    shown = runtime.subscribe("/controlled_stream").take(5)
    assert image.data.tobytes() == shown.pixels.tobytes()


def test_messages_are_encoded_once_and_for_subscribers_alone(page, port, runtime, monkeypatch):
    encoded = []
    encode = Encoder.encode
    monkeypatch.setattr(
        Encoder, "encode", lambda self, one: encoded.append(one) or encode(self, one)
    )
    viewers = [Viewer(port), Viewer(port)]
    channels = [viewer.channel("/edges")["id"] for viewer in viewers]
    assert channels[0] == channels[1]
    assert not encoded
    for viewer in viewers:
        viewer.send("subscribe", subscriptions=[{"id": 1, "channelId": channels[0]}])
        viewer.wait(1)
    runtime.playback.step()
    bodies = [viewer.wait(1) for viewer in viewers]
    assert bodies[0] == bodies[1]
    assert len(encoded) == 2
    for viewer in viewers:
        viewer.send("unsubscribe", subscriptionIds=[1])
        viewer.parameters()  # it has been heard
    runtime.playback.step()
    wait_for(lambda: runtime.report().nodes["edge_detector"].processed >= 3)
    viewers[0].parameters()
    assert len(encoded) == 2
    for viewer in viewers:
        viewer.socket.close()


def test_parameters_are_read_set_and_followed(viewer, runtime):
    viewer.wait("advertise")
    there = viewer.parameters()
    assert there["/filters.threshold"] == 128
    assert viewer.parameters("/filters.threshold", "/no.such") == {"/filters.threshold": 128}
    viewer.send("subscribeParameterUpdates", parameterNames=["/filters.threshold"])
    given = [{"name": "/filters.threshold", "value": 99}]
    viewer.send("setParameters", parameters=given, id="set")
    viewer.wait("parameterValues", lambda one: one.get("id") == "set")
    assert runtime.parameters["filters"].current.threshold == 99
    runtime.parameters["filters"].update({"threshold": 55})
    viewer.wait("parameterValues", lambda one: one["parameters"][0]["value"] == 55)


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("threshold", 256, "from 0 to 255"),
        ("threshold", "1", "a whole number"),
        ("threshold", True, "a whole number"),
        ("threshold", None, "a whole number"),
        ("threshold", [1], "a whole number"),
        ("threshold", {"a": 1}, "a whole number"),
        ("threshold", 1.5, "a whole number"),
        ("threshold", 10**40, "0 to 255"),
        ("no_such", 1, "no parameter"),
    ],
)
def test_bad_values_are_answered_and_change_nothing(viewer, runtime, name, value, reason):
    before = runtime.parameters["filters"].current
    good = {"name": "/filters.threshold", "value": 77}
    given = [good, {"name": f"/filters.{name}", "value": value}]
    viewer.wait("advertise")
    viewer.send("setParameters", parameters=given, id="bad")
    assert reason in viewer.error()
    answered = viewer.wait("parameterValues", lambda one: one.get("id") == "bad")["parameters"]
    assert answered[0]["value"] == 128
    assert runtime.parameters["filters"].current == before


@pytest.mark.parametrize(
    "message",
    [
        "",
        "{",
        "[]",
        "[" * 60_000,
        '{"op": "no such"}',
        '{"op": "subscribe", "subscriptions": 7}',
        '{"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 1}]}',
        '{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 4294967296}]}',
        '{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 999}]}',
        '{"op": "setParameters", "parameters": [{"name": 5, "value": 1}]}',
        '{"op": "setParameters", "parameters": [{"name": "/a.b", "value": ' + "9" * 5000 + "}]}",
        '{"op": "setParameters", "parameters": [{"name": "/filters.threshold", "value": NaN}]}',
        json.dumps({"op": "getParameters", "parameterNames": ["x"] * 3000}),
        json.dumps({"op": "getParameters", "id": "x" * 300}),
        b"",
        b"\x01" + bytes(40),
        b"\x02",
        b"\x02" + struct.pack("<III", 1, 1, 2**32 - 1) + b"cdr",
        b"\x03\x00",
        control(True, float("nan"), None, "x"),
        control(True, 1.0, None, "x")[:-1],
        b"\x03\x07" + control(True, 1.0, None, "x")[2:],
        b"\xff" * 60_000,
    ],
)
def test_malformed_requests_are_answered_and_end_nothing(viewer, message):
    viewer.wait("advertise")
    viewer.socket.send(message)
    assert viewer.error()
    assert viewer.parameters()


def test_actions_are_services(port, tmp_path):
    with flown(port, tmp_path):
        viewer = Viewer(port)
        services = viewer.wait("advertiseServices")["services"]
        clear = next(one for one in services if one["name"] == "/path/clear")
        assert clear["type"] == "std_srvs/srv/Trigger"
        older = (clear["requestSchema"], clear["responseSchema"])  # read by viewers of 2023
        assert older == (clear["request"]["schema"], clear["response"]["schema"])
        request = struct.pack("<BIII", 2, clear["id"], 5, 3) + b"cdr" + b"\0\1\0\0\0"
        viewer.socket.send(request)
        answer = viewer.wait(3)
        assert struct.unpack_from("<III3s4s?", answer, 1) == (
            *(clear["id"], 5, 3),
            *(b"cdr", b"\0\1\0\0", True),
        )
        for number, encoding in (999, b"cdr"), (clear["id"], b"ros1"):
            head = struct.pack("<BIII", 2, number, 6, len(encoding))
            viewer.socket.send(head + encoding)
            assert viewer.wait("serviceCallFailure")["callId"] == 6
        viewer.socket.close()


def test_playback_is_controlled_by_the_times_of_the_recording(port, tmp_path):
    with flown(port, tmp_path) as playback:
        viewer = Viewer(port)
        info = viewer.wait("serverInfo", lambda one: "dataEndTime" in one)
        start, end = (
            info[name]["sec"] * 10**9 + info[name]["nsec"]
            for name in ("dataStartTime", "dataEndTime")
        )
        assert end - start == 39 * 10**9
        channel = viewer.channel("/gps/fix")
        viewer.send("subscribe", subscriptions=[{"id": 1, "channelId": channel["id"]}])
        first_ns = struct.unpack_from("<Q", viewer.wait(1), 5)[0]
        assert first_ns == start
        viewer.socket.send(control(False, 2.0, start + 17 * 10**9, "there"))
        found = state_of(viewer.wait(5, lambda one: state_of(one)[4] == "there"))
        assert found == (1, start + 17 * 10**9, 2.0, 1, "there")
        viewer.wait(1, lambda one: struct.unpack_from("<Q", one, 5)[0] == start + 17 * 10**9)
        viewer.wait(2, lambda one: struct.unpack_from("<Q", one, 1)[0] == start + 17 * 10**9)
        assert playback.state[:3] == (17, 39, False)
        viewer.socket.send(control(True, 0.0, None, "still"))
        assert "above 0" in viewer.error()
        assert state_of(viewer.wait(5, lambda one: state_of(one)[4] == "still"))[0] == 1
        viewer.socket.send(control(True, 50.0, None, "on"))
        assert state_of(viewer.wait(5, lambda one: state_of(one)[4] == "on"))[0] == 0
        viewer.wait(5, lambda one: state_of(one)[0] == 3)  # its end
        playback.pause()
        playback.seek(3)  # by somebody else
        found = state_of(viewer.wait(5, lambda one: state_of(one)[3]))
        assert found[1] == start + 3 * 10**9
        viewer.socket.close()


def test_who_may_only_look_changes_nothing(port, tmp_path):
    with flown(port, tmp_path) as playback:
        viewer = Viewer(port, token=VIEW_TOKEN)
        info = viewer.wait("serverInfo")
        assert "playbackControl" not in info["capabilities"]
        viewer.wait("advertise")
        assert viewer.parameters()["/path.max_poses"] == 10_000
        viewer.send("setParameters", parameters=[{"name": "/path.max_poses", "value": 99}])
        assert "read-only" in viewer.error()
        viewer.socket.send(control(True, 1.0, None, "x"))
        assert "read-only" in viewer.error()
        viewer.socket.send(struct.pack("<BIII", 2, 1, 6, 3) + b"cdr")
        assert "read-only" in viewer.wait("serviceCallFailure")["message"]
        assert not playback.state.playing
        viewer.socket.close()


def test_another_graph_takes_the_place_of_the_first(page, port, runtime):
    viewer = Viewer(port)
    first = viewer.wait("serverInfo")["sessionId"]
    edges = viewer.channel("/edges")["id"]
    viewer.send("subscribe", subscriptions=[{"id": 1, "channelId": edges}])
    viewer.wait(1)
    other = LocalRuntime(runtime.graph, Playback(hold=True))
    other.start()
    page.open(other)
    assert edges in viewer.wait("unadvertise")["channelIds"]
    assert viewer.wait("serverInfo")["sessionId"] != first
    again = viewer.channel("/edges")["id"]
    viewer.send("subscribe", subscriptions=[{"id": 1, "channelId": again}])
    viewer.wait(1)
    viewer.socket.close()
    other.stop()


def drained(queue):
    """What waits in a queue."""
    found = []
    while queue.waits:
        coroutine = queue.take()
        with pytest.raises(StopIteration) as done:
            coroutine.send(None)
        found.append(done.value.value)
    return found


def test_the_newest_messages_stay_and_drops_are_counted():
    queue = ViewerQueue()
    for number in range(1000):
        queue.put(1, 1, number, b"small")
    for number in range(20):
        queue.put(2, 2, number, bytes(4 << 20))
    queue.put(1, 1, 1000, b"small")
    queue.reply("first")
    first, *rest = drained(queue)
    assert first == "first"
    logged = [struct.unpack_from("<IQ", one, 1) for one in rest]
    small = [log_ns for number, log_ns in logged if number == 1]
    large = [log_ns for number, log_ns in logged if number == 2]
    assert small == list(range(901, 1001))
    assert large == list(range(17, 20)), "of 16 MiB"
    assert logged[-1] == (1, 1000), "in the order in which they came"
    assert queue.dropped == {1: 901, 2: 17}


def test_one_message_that_is_larger_than_all_is_sent():
    queue = ViewerQueue()
    queue.put(1, 1, 0, bytes(40 << 20))
    assert len(drained(queue)[0]) == 13 + (40 << 20)

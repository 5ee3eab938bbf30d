"""Zenoh's own: keys as rmw_zenoh has them, and peers that send what they should not."""

from __future__ import annotations

import json
import random
import struct
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import zenoh
from hosts import GivenHost, running
from waiting import wait_for
from zenoh_net import ZenohNet, zenoh_net

from ros_visualise.core.errors import (
    OpenError,
    ParameterError,
    RosVisualiseError,
    Unreachable,
    UsageError,
)
from ros_visualise.core.params import Parameters, param
from ros_visualise.core.supervision import PROCESS
from ros_visualise.data import Header, Image, Path, Text
from ros_visualise.messages.qos import LATCHED, QoS
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.remote.runtime import RemoteRuntime
from ros_visualise.runtime.zenoh import keys
from ros_visualise.runtime.zenoh.keys import Entity
from ros_visualise.runtime.zenoh.session import Endpoints
from ros_visualise.runtime.zenoh.transport import ZenohTransport

STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"


@pytest.fixture
def net() -> Iterator[ZenohNet]:
    with zenoh_net() as made:
        yield made


@pytest.fixture
def stock(net: ZenohNet) -> Iterator[zenoh.Session]:
    """A peer that is not ours."""
    config = {"mode": "client", "connect": {"endpoints": [net.address]}}
    with zenoh.open(zenoh.Config.from_json5(json.dumps(config))) as session:
        yield session


@pytest.fixture
def viewer(net: ZenohNet) -> Iterator[RemoteRuntime]:
    with closing(net.join("viewer")) as transport, closing(RemoteRuntime(transport)) as made:
        yield made


def test_keys_are_those_of_the_design_document_of_rmw_zenoh() -> None:
    topic = keys.topic_key("/chatter", "std_msgs/msg/String", STRING_HASH)
    assert topic == f"0/chatter/std_msgs::msg::dds_::String_/{STRING_HASH}"
    talker = Entity(keys.PUBLISHER, "8b20917502ee955ac4476e0266340d5c", "/talker")
    talker = talker._replace(name="/chatter", type="std_msgs/msg/String")
    token = keys.token(talker, 10, STRING_HASH, QoS(depth=7))
    assert token == (
        "@ros2_lv/0/8b20917502ee955ac4476e0266340d5c/0/10/MP/%/%/talker/%chatter/"
        f"std_msgs::msg::dds_::String_/{STRING_HASH}/::,7:,:,:,,"
    )
    assert keys.parse(token) == talker
    node = Entity(keys.NODE, "aac3178e146ba6f1fc6e6a4085e77f21", "/listener")
    assert keys.token(node, 0) == f"@ros2_lv/0/{node.session}/0/0/NN/%/%/listener"
    assert keys.parse(keys.token(node, 0)) == node
    place = Entity(keys.PARAMETERS, "1f", "/uav1/demo", "/uav1/demo/filters")
    assert keys.parse(keys.token(place, 3)) == place


def test_an_attachment_is_a_number_a_time_and_an_id_of_16_bytes() -> None:
    attachments = keys.Attachments("token")
    first, second = (struct.unpack("<qqB16s", attachments.next()) for _ in range(2))
    assert (first[0], second[0], first[2]) == (1, 2, 16)
    assert first[3] == second[3]


def test_messages_that_never_came_are_counted_by_their_numbers() -> None:
    one, other = keys.Attachments("one"), keys.Attachments("other")
    sent = [one.next() for _ in range(9)]
    gaps = keys.Gaps()
    for taken in (sent[3], sent[4], sent[7], other.next(), sent[8], b"damage"):
        gaps.take(taken)
    assert gaps.missing == 2
    gaps.take(sent[6])  # late
    assert gaps.missing == 1
    gaps.take(struct.pack("<qqB16s", 2**62, 0, 16, sent[0][17:]))
    assert gaps.missing == 1


def test_a_message_beyond_the_limit_is_counted(net: ZenohNet, monkeypatch: Any) -> None:
    with closing(net.join("camera")) as camera:
        monkeypatch.setattr("ros_visualise.runtime.zenoh.session.max_memory", lambda: 1 << 20)
        with closing(net.join("viewer")) as viewer:
            heard: list[str] = []
            said = viewer.subscribe("/said", Text, lambda one: heard.append(one.text), pytest.fail)
            published = camera.advertise("/said", TopicType(Text.type_name))
            wait_for(lambda: published.connections, "the subscriber")
            for text in ("small", "x" * (1 << 20), "last"):
                published.publish(Text(text))
            wait_for(lambda: "last" in heard, "the last")
            assert (heard, said.dropped) == (["small", "last"], 1)


PIECES = ["", "%", "MP", "NN", "PS", "x" * 3000, "@", "::"]


def test_tokens_of_any_text_are_entities_or_nothing() -> None:
    dice = random.Random(7)
    whole = keys.token(Entity("MP", "1f", "/a/b", "/c/d", "e/msg/F"), 1, "RIHS01_0")
    for _ in range(20_000):
        parts = whole.split("/")
        for _ in range(dice.randint(1, 4)):
            parts[dice.randrange(len(parts))] = dice.choice(
                ["", "%", "MP", "NN", "PS", "x" * 3000, "@", "::"]
            )
        dice.shuffle(parts) if dice.random() < 0.2 else None
        found = keys.parse("/".join(parts[: dice.randint(1, 13)]))
        assert found is None or found.node.startswith("/")


def test_what_is_latched_comes_to_who_joins_late(net: ZenohNet) -> None:
    with closing(net.join("early")) as early, closing(net.join("late")) as late:
        published = early.advertise("~said", TopicType(Text.type_name, qos=LATCHED))
        for text in ("before", "last"):
            published.publish(Text(text))
        published.flush(5)
        heard: list[Text] = []
        late.subscribe("/early/said", Text, heard.append, pytest.fail)
        wait_for(lambda: heard, "what was latched")
        published.publish(Text("now"))
        wait_for(lambda: len(heard) == 2, "what came after it")
        assert [one.text for one in heard] == ["last", "now"]


def test_several_messages_of_small_kinds_wait_and_none_is_lost(net: ZenohNet) -> None:
    with closing(net.join("one")) as one, closing(net.join("other")) as other:
        heard: list[Text] = []
        other.subscribe("/said", Text, heard.append, pytest.fail)
        published = one.advertise("/said", TopicType(Text.type_name))
        wait_for(lambda: published.connections, "the subscriber")
        for number in range(200):
            published.publish(Text(str(number)))
        wait_for(lambda: len(heard) == 200, "all of them")
        assert [int(one.text) for one in heard] == list(range(200))
        assert published.dropped == 0


@dataclass(frozen=True)
class Odd:
    """Parameters of a node that is not ours."""

    gain: float = param(1.5, "how much", min=0, max=float("inf"))
    mode: str = param("a", "how")
    on: bool = param(True, "whether")


def test_parameters_of_any_node_are_followed_and_set(net: ZenohNet, viewer: RemoteRuntime) -> None:
    parameters = Parameters(Odd())
    with closing(net.join("odd")) as transport:
        served = transport.serve_parameters(parameters, "part")
        remote = wait_for(lambda: viewer.parameters.get("odd/part"), "the node")
        wait_for(lambda: vars(remote.current), "its parameters")
        assert vars(remote.current) == vars(Odd())
        remote.update({"gain": 3})
        assert parameters.current.gain == 3
        parameters.update({"mode": "b"})
        wait_for(lambda: remote.current.mode == "b", "the change")
        with pytest.raises(ParameterError):
            remote.update({"gain": -1})
        served.close()
        wait_for(lambda: not remote.connected, "the end")


DESCRIPTIONS: list[bytes] = [
    b"",
    b"\xff\xfe",
    b"[]",
    b"{" * 100_000,
    b'{"parameters": [{"name": "a b", "type": "int", "default": 1}], "values": {}}',
    b'{"parameters": [{"name": "__class__", "type": "int", "default": 1}], "values": {}}',
    b'{"parameters": [{"name": "a", "type": "code", "default": 1}], "values": {}}',
    b'{"parameters": [{"name": "a", "type": "int", "default": "x", "min": 9}], "values": {"a": 1}}',
    b'{"parameters": [], "values": {"a": [1, 2]}}',
    b'{"parameters": "' + b"x" * (2 << 20) + b'", "values": {}}',
]


@pytest.mark.parametrize("description", DESCRIPTIONS, ids=range(len(DESCRIPTIONS)))
def test_a_peer_with_damaged_parameters_disturbs_nobody(
    net: ZenohNet, stock: zenoh.Session, viewer: RemoteRuntime, description: bytes
) -> None:
    key = keys.parameters_key("/bad")

    def reply(query: zenoh.Query) -> None:
        with query:
            query.reply(key, description)

    stock.declare_queryable(key, reply)
    bad = Entity(keys.PARAMETERS, str(stock.zid()), "/bad", "/bad")
    _ = stock.liveliness().declare_token(keys.token(bad, 1))
    with running("filters", GivenHost(net.join)):
        good = wait_for(lambda: viewer.parameters.get("filters"), "a node of ours")
        wait_for(lambda: vars(good.current), "its parameters")
        stock.put(key, description)
        good.update({"threshold": 9})
        assert good.current.threshold == 9
    assert not PROCESS.failures


def test_requests_that_make_no_sense_are_refused(net: ZenohNet, stock: zenoh.Session) -> None:
    parameters = Parameters(Odd())
    with closing(net.join("odd")) as transport:
        transport.serve_parameters(parameters, "")
        transport.offer("~act", lambda: "done")
        wait_for(lambda: ask(stock, keys.parameters_key("/odd"), None), "the node")
        for payload in (b"", b"\x00", b"[1]", b'{"gain": "x"}', b'{"other": 1}', b"1" * (2 << 20)):
            refused = ask(stock, keys.parameters_key("/odd"), payload)
            assert refused.err is not None, payload[:20]
        assert parameters.current == Odd()
        trigger = keys.topic_key("/odd/act", *keys.TRIGGER)
        for payload in (None, b"", b"\xff" * 1000):
            assert b"done" in ask(stock, trigger, payload).ok.payload.to_bytes()
    assert not PROCESS.failures


def ask(session: zenoh.Session, key: str, payload: bytes | None) -> Any:
    return next(iter(session.get(key, payload=payload, timeout=5)), None)


def test_a_topic_that_is_flooded_with_damage_counts_each_and_goes_on(
    net: ZenohNet, stock: zenoh.Session
) -> None:
    dice = random.Random(3)
    with closing(net.join("one")) as transport:
        heard: list[Path] = []
        rejected: list[str] = []
        transport.subscribe("/path", Path, heard.append, rejected.append)
        published = transport.advertise("/path", TopicType(Path.type_name))
        key = keys.topic_key("/path", Path.type_name, "RIHS01_any")
        flood = stock.declare_publisher(key, congestion_control=zenoh.CongestionControl.BLOCK)
        wait_for(lambda: flood.matching_status.matching, "the subscriber")
        for size in range(150):
            flood.put(dice.randbytes(size))
        wait_for(lambda: len(rejected) == 150, "all of them")
        path = Path(np.array([1]), np.zeros((1, 3)), np.array([[0.0, 0, 0, 1]]), Header(1, "map"))
        published.publish(path)
        wait_for(lambda: heard, "a good one")
    assert not PROCESS.failures


def test_an_address_that_cannot_be_used_is_an_error_of_ours(net: ZenohNet) -> None:
    with pytest.raises(OpenError, match="cannot listen"):
        ZenohTransport("other", Endpoints(listen=[net.address]))
    for endpoints in (
        Endpoints(),
        Endpoints(connect=["what"]),
        Endpoints(["tcp/a:1"], ["tcp/b:2"]),
    ):
        with pytest.raises(UsageError):
            ZenohTransport("other", endpoints)


def test_a_peer_is_not_waited_for_any_longer_than_asked() -> None:
    with pytest.raises(Unreachable, match=r"no peer found at tcp/127\.0\.0\.1:1 within 0\.1 s"):
        ZenohTransport("viewer", Endpoints(connect=["tcp/127.0.0.1:1"], wait_s=0.1))


def test_who_has_left_raises_errors_of_ours(net: ZenohNet) -> None:
    transport = net.join("gone")
    published = transport.advertise("/x", TopicType(Image.type_name))
    transport.close()
    transport.close()
    published.publish(Image(np.zeros((1, 1), np.uint8), "mono8", Header(1, "camera")))
    for call in (
        lambda: transport.advertise("/y", TopicType(Image.type_name)),
        lambda: transport.subscribe("/y", Image, print, print),
        lambda: transport.offer("/y", str),
        lambda: transport.call("/y"),
        lambda: transport.listing(),
    ):
        with pytest.raises(RosVisualiseError):
            call()

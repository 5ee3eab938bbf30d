"""Publisher and Subscriber on a real graph: among themselves and with rospy's own."""

import threading
import xmlrpc.client
from typing import Any

import genpy
import numpy as np
import pytest
import rospy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry, Path
from peer import is_whole, numbered
from peers import Peers, connect
from ros_graph import wait_for
from rospy import topics
from rospy.impl.registration import get_topic_manager
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2, PointField

from ros_visualise.runtime.ros1 import topics as own_topics
from ros_visualise.runtime.ros1.topics import Ros1Publisher, Ros1Subscriber

MEGABYTE = 1_000_000


@pytest.fixture
def peers(ros_master):
    peers = Peers(ros_master)
    yield peers
    peers.stop()


@pytest.fixture
def opened(ros_master):
    """Closes what a test opens."""
    there: list[Any] = []

    def keep(one: Any) -> Any:
        there.append(one)
        return one

    yield keep
    for one in there:
        one.unregister() if hasattr(one, "unregister") else one.close()


def numbers(received: list[Image]) -> list[int]:
    assert all(is_whole(message) for message in received)
    return [message.header.stamp.secs for message in received]


@pytest.mark.parametrize(
    "message",
    [
        Image(height=1, width=6, encoding="mono8", step=6, data=b"pixels"),
        Image(),
        CompressedImage(format="png", data=b"not one"),
        PointCloud2(fields=[PointField("x", 0, 7, 1)], data=b"4321", is_dense=True),
        Path(poses=[PoseStamped(), PoseStamped()]),
        Odometry(child_frame_id="base"),
        CameraInfo(D=[1.0, 2.0], distortion_model="plumb_bob"),
    ],
    ids=lambda message: f"{type(message).__name__}-{len(getattr(message, 'data', 'x'))}",
)
@pytest.mark.parametrize("by", ["ours", "rospy"])
def test_messages_arrive(opened, message, by):
    topic = f"/arrive/{by}/{type(message).__name__}{len(getattr(message, 'data', ''))}"
    kind, got = type(message), []
    opened(Ros1Subscriber(topic, kind, got.append))
    if by == "ours":
        publisher = opened(Ros1Publisher(topic, kind))
        connect(publisher)
    else:
        publisher = opened(rospy.Publisher(topic, kind, queue_size=1))
        wait_for(publisher.get_num_connections, topic)
    publisher.publish(message)
    [found] = wait_for(lambda: got, "a message")
    if hasattr(message, "data"):
        assert type(found.data) is np.ndarray
        assert found.data.dtype == np.uint8
        found.data = found.data.tobytes()
    assert found == message
    assert found.header.seq == 1
    assert found._connection_header["callerid"] == "/tests"


def test_rospy_in_another_process_gets_ours(opened, peers):
    publisher = opened(Ros1Publisher("/to_rospy", Image))
    peer = peers.start("subscribe", "rospy", "/to_rospy")
    connect(publisher)
    for number in range(1, 21):
        publisher.publish(numbered(number, MEGABYTE))
        publisher.flush(60)
    wait_for(lambda: len(peer.told) == 20, "20 messages")
    assert peer.told == [[n, n, MEGABYTE, True] for n in range(1, 21)]
    assert publisher.dropped == 0


def test_ours_gets_what_rospy_in_another_process_sends(opened, peers):
    got: list[Image] = []
    peers.start("publish", "rospy", "/from_rospy", MEGABYTE, 50)
    wait_for(lambda: "/from_rospy" in dict(rospy.get_published_topics()), "its publisher")
    subscriber = opened(Ros1Subscriber("/from_rospy", Image, got.append))
    wait_for(lambda: len(got) >= 20, "20 messages")
    assert subscriber.connections == 1
    found = numbers(got[:20])
    assert found == sorted(set(found))


def test_only_our_own_topics_go_our_way(opened):
    before = [topics._PublisherImpl, topics._SubscriberImpl]
    opened(Ros1Publisher("/ours_alone", Image))
    opened(Ros1Subscriber("/ours_alone", Image, print))
    opened(rospy.Publisher("/theirs_alone", Image, queue_size=1))
    opened(rospy.Subscriber("/theirs_alone", Image, print))
    manager = get_topic_manager()
    for there in (manager.pubs, manager.subs):
        assert type(there["/theirs_alone"]) in before
        assert type(there["/ours_alone"]) not in before
    assert before == [topics._PublisherImpl, topics._SubscriberImpl]


@pytest.mark.parametrize("first", ["ours", "rospy"])
def test_both_kinds_of_subscribers_in_one_process(opened, first):
    topic = f"/both_subscribe/{first}"
    ours: list[Image] = []
    theirs: list[Image] = []
    makers = {
        "ours": lambda: opened(Ros1Subscriber(topic, Image, ours.append)),
        "rospy": lambda: opened(rospy.Subscriber(topic, Image, theirs.append)),
    }
    for name in sorted(makers, key=lambda name: name != first):
        makers[name]()
    publisher = opened(Ros1Publisher(topic, Image))
    connect(publisher)
    publisher.publish(numbered(3, 100))
    wait_for(lambda: ours and theirs, "both")
    assert numbers(ours) == numbers(theirs) == [3]
    assert type(ours[0].data) is np.ndarray
    assert type(theirs[0].data) is (bytes if first == "rospy" else np.ndarray)


@pytest.mark.parametrize("first", ["ours", "rospy"])
def test_both_kinds_of_publishers_in_one_process(opened, first):
    topic = f"/both_publish/{first}"
    makers = {
        "ours": lambda: opened(Ros1Publisher(topic, Image)),
        "rospy": lambda: opened(rospy.Publisher(topic, Image, queue_size=9)),
    }
    made = {name: makers[name]() for name in sorted(makers, key=lambda name: name != first)}
    got: list[Image] = []
    opened(Ros1Subscriber(topic, Image, got.append))
    connect(made["ours"])
    made["ours"].publish(numbered(1, 100))
    message = numbered(2, 100)
    message.data = message.data.tobytes()
    made["rospy"].publish(message)
    wait_for(lambda: len(got) == 2, "both")
    assert numbers(got) == [1, 2]
    assert [message.header.seq for message in got] == [1, 2]


def test_several_publishers_and_subscribers_of_a_topic(opened, peers):
    first: list[Image] = []
    second: list[Image] = []
    subscriber = opened(Ros1Subscriber("/several", Image, first.append))
    opened(Ros1Subscriber("/several", Image, second.append))
    one, other = (opened(Ros1Publisher("/several", Image)) for _ in range(2))
    peers.start("publish", "ours", "/several", 1000, 20)
    wait_for(lambda: subscriber.connections == 2, "another process")
    connect(one)
    one.publish(numbered(1001, 9))
    other.publish(numbered(1002, 9))
    wait_for(lambda: len({1001, 1002} & set(numbers(second))) == 2, "both of this process")
    wait_for(lambda: min(numbers(second)) < 1000, "that of the other process")
    one.close()
    one.publish(numbered(1003, 9))
    other.publish(numbered(1004, 9))
    wait_for(lambda: 1004 in numbers(first), "the other one still publishes")
    assert 1003 not in numbers(first)


@pytest.mark.parametrize("by", ["ours", "rospy"])
def test_whoever_comes_late_gets_what_was_latched(opened, peers, by):
    publisher = opened(Ros1Publisher(f"/latched/{by}", Image, latch=True))
    publisher.publish(numbered(1, 5))
    publisher.publish(numbered(2, MEGABYTE))
    first, second = (peers.start("subscribe", by, publisher.name) for _ in range(2))
    wait_for(lambda: first.told and second.told, "the latched message")
    assert first.numbers == second.numbers == [2]
    publisher.publish(numbered(3, MEGABYTE))
    wait_for(lambda: first.numbers == second.numbers == [2, 3], "a new message")


def test_another_subscriber_in_the_process_gets_what_was_latched(opened):
    publisher = opened(Ros1Publisher("/latched_here", Image, latch=True))
    publisher.publish(numbered(1, 5))
    first: list[Image] = []
    second: list[Image] = []
    opened(Ros1Subscriber("/latched_here", Image, first.append))
    wait_for(lambda: first, "the latched message")
    opened(Ros1Subscriber("/latched_here", Image, second.append))
    assert numbers(first) == numbers(second) == [1]


def test_many_threads_may_publish(opened):
    got: list[Image] = []
    opened(Ros1Subscriber("/threads", Image, got.append))
    publisher = opened(Ros1Publisher("/threads", Image))
    connect(publisher)

    def publish(start: int) -> None:
        for number in range(start, start + 50):
            publisher.publish(numbered(number, 50_000))

    threads = [threading.Thread(target=publish, args=(start,)) for start in range(0, 400, 50)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    wait_for(lambda: len(got) + publisher.dropped == 400, "all that were not dropped")
    assert len(set(numbers(got))) == len(got)
    counted = [message.header.seq for message in got]
    assert counted == sorted(set(counted))
    assert counted[-1] == 400


def test_counts_are_those_that_rosnode_asks_for(opened, peers, ros_master):
    publisher = opened(Ros1Publisher("/counted", Image))
    peer = peers.start("subscribe", "ours", "/counted")
    connect(publisher)
    for number in range(1, 4):
        publisher.publish(numbered(number, 1000))
    wait_for(lambda: len(peer.told) == 3, "3 messages")
    assert rospy.get_node_uri()
    node = xmlrpc.client.ServerProxy(rospy.get_node_uri())
    _, _, (published, *_) = node.getBusStats("/tests")
    [(sent, connections)] = [rest for name, *rest in published if name == "/counted"]
    [(_, bytes_sent, count, connected)] = connections
    raw = len(own_topics.encode(numbered(1, 1000), 1).buffers[0]) + 1000
    assert sent == 3 * raw
    assert bytes_sent >= sent  # and the handshake
    assert (count, connected) == (3, True)
    [bus] = [info for info in node.getBusInfo("/tests")[2] if info[4] == "/counted"]
    assert bus[1].startswith("/subscribe")
    assert bus[2:4] == ["o", "TCPROS"]

    name = bus[1]
    _, _, uri = ros_master.proxy().lookupNode("/tests", name)
    _, _, (_, subscribed, _) = xmlrpc.client.ServerProxy(uri).getBusStats("/tests")
    [[(_, received, count, _, connected)]] = [c for n, c in subscribed if n == "/counted"]
    assert (count, connected) == (3, True)
    assert received >= sent
    assert "/counted" in ros_master.call("rosnode", "info", "/tests")
    assert "direction: outbound" in ros_master.call("rosnode", "info", "/tests")
    info = ros_master.call("rostopic", "info", "/counted")
    assert "Type: sensor_msgs/Image" in info
    assert "* /tests" in info
    assert f"* {name}" in info


def test_statistics_are_kept_where_they_are_asked_for(opened):
    from rosgraph_msgs.msg import TopicStatistics

    told: list[TopicStatistics] = []
    got: list[Image] = []
    opened(rospy.Subscriber("/statistics", TopicStatistics, told.append))
    rospy.set_param("/enable_statistics", True)
    try:
        opened(Ros1Subscriber("/measured", Image, got.append))
    finally:
        rospy.delete_param("/enable_statistics")
    publisher = opened(Ros1Publisher("/measured", Image))
    connect(publisher)
    number = iter(range(1, 10_000))
    wait_for(lambda: publisher.publish(numbered(next(number), 10)) or told, "statistics")
    assert (told[0].topic, told[0].node_sub, told[0].node_pub) == ("/measured", "/tests", "/tests")
    assert numbers(got)


@pytest.fixture
def unknown_rospy(monkeypatch, ros_master):
    """A rospy that is not built as ours expects it."""
    monkeypatch.setattr(own_topics, "TCPROSTransport", object)
    own_topics._fits.cache_clear()
    yield
    own_topics._fits.cache_clear()


def test_an_unknown_rospy_does_it_all_by_itself(unknown_rospy, opened, caplog):
    for name, large in (("/slow", True), ("/slow_small", False)):
        kind = Image if large else Odometry
        got: list[Any] = []
        subscriber = opened(Ros1Subscriber(name, kind, got.append))
        publisher = opened(Ros1Publisher(name, kind))
        connect(publisher)
        assert isinstance(get_topic_manager().pubs[name], topics._PublisherImpl)
        assert not isinstance(get_topic_manager().pubs[name], own_topics._PublisherImpl)
        message = numbered(5, 1000) if large else Odometry(child_frame_id="base")
        publisher.publish(message)
        [found] = wait_for(lambda got=got: got, "a message")
        if large:
            assert type(found.data) is type(message.data) is np.ndarray
            assert numbers(got) == [5]
            with pytest.raises(genpy.SerializationError):
                publisher.publish(Image(data="text"))
        publisher.flush(1)
        assert (subscriber.connections, publisher.dropped) == (1, 0)
        publisher.close()
        publisher.publish(message)
    assert [r.getMessage() for r in caplog.records if "unsupported" in r.getMessage()] == [
        "unsupported rospy; using the stock transport, which is slower with large images"
    ]


def test_what_cannot_be_sent_is_refused(opened):
    publisher = opened(Ros1Publisher("/refused", Image))
    got: list[Image] = []
    opened(Ros1Subscriber("/refused", Image, got.append))
    connect(publisher)
    for data in ("text", [300], np.zeros(9, np.uint8)[::2]):
        with pytest.raises(genpy.SerializationError, match="not a buffer of bytes"):
            publisher.publish(Image(data=data))
    publisher.publish(numbered(1, 9))
    wait_for(lambda: got, "the next message")
    assert numbers(got) == [1]

"""Looking at nodes in other processes: who is there, what they publish, what is recorded of it."""

import logging
import subprocess
import sys
import threading
import time

import cv2
import numpy as np
import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from ros_graph import PATIENCE_S, end, wait_for
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import CompressedImage as RosCompressed
from sensor_msgs.msg import Image as RosImage

from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.core.params import Parameters
from ros_visualise.data import Image, OccupancyGrid, Odometry, PointCloud, Transforms
from ros_visualise.nodes import find
from ros_visualise.runtime.remote.graph_snapshot import RemoteNode, in_order, snapshot
from ros_visualise.runtime.remote.runtime import RemoteRuntime
from ros_visualise.runtime.report import NodeReport, OutputReport, TopicReport
from ros_visualise.runtime.ros1.reconfigure_server import ReconfigureServer
from ros_visualise.runtime.ros1.transport import Ros1Transport, list_graph
from ros_visualise.sources.opening import open_recording

pytestmark = [
    pytest.mark.usefixtures("ros_master"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),  # rospy leaves sockets to the collector
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore:notifyAll:DeprecationWarning"),  # rospy's threads
]


PEER = """
import sys, rospy
from sensor_msgs.msg import Image
from ros_visualise.nodes import find
from ros_visualise.core.params import Parameters
from ros_visualise.runtime.ros1.reconfigure_server import ReconfigureServer
name, takes, gives = sys.argv[1:4]
rospy.init_node(name)
publishers = [rospy.Publisher(gives, Image, queue_size=1) for gives in gives.split()]
taken = rospy.Subscriber(takes, Image, lambda _: None) if takes else None
server = ReconfigureServer(Parameters(find(name).params())) if name != "plain" else None
number = 0
while not rospy.is_shutdown():
    number += 1
    for n, publisher in enumerate(publishers):
        image = Image(height=2, width=3, step=3, encoding="mono8", data=bytes([n] * 6))
        image.header.stamp = rospy.Time(number, 5)
        image.header.frame_id = "camera_optical"
        publisher.publish(image)
    rospy.sleep(0.02)
"""


@pytest.fixture
def peer(ros_master):
    """``peer(name, takes, gives)`` starts a node that publishes images of 3x2 pixels."""
    started = []

    def start(name, takes, gives):
        started.append(subprocess.Popen([sys.executable, "-c", PEER, name, takes, gives]))
        return started[-1]

    yield start
    for process in started:
        end(process)


@pytest.fixture
def runtime():
    made = RemoteRuntime(Ros1Transport())
    yield made
    made.close()


def node(runtime, name):
    """The node of that name, as soon as its parameters are known."""
    found = next((node for node in runtime.graph.nodes if node.name == name), None)
    known = name == "plain" or (found and vars(found.params))
    return found if known else None


def subscribed(topic):
    """Whether this process has subscribed to a topic."""
    _, subscribers, _ = rospy.get_master().getSystemState()[2]
    return rospy.get_name() in dict(subscribers).get(topic, [])


def test_a_snapshot_has_images_and_parameters_and_no_onlookers():
    publishers = [
        ("/image_raw", ["/camera"]),
        ("/image_raw/compressed/parameter_descriptions", ["/camera"]),
        ("/image_raw/compressed", ["/camera"]),
        ("/edges", ["/edge_detector"]),
        ("/edge_detector/parameter_descriptions", ["/edge_detector"]),
        ("/pipeline/a/parameter_descriptions", ["/pipeline"]),
        ("/rosout_agg", ["/rosout"]),
        ("/drawn", ["/rviz_1"]),
        ("/scan", ["/laser"]),
    ]
    subscribers = [
        ("/image_raw", ["/edge_detector", "/record_123", "/own", "/image_view"]),
        ("/edges", ["/rviz_1", "/rviz_2"]),
    ]
    description = "dynamic_reconfigure/ConfigDescription"
    types = [(t, "sensor_msgs/Image") for t in ("/image_raw", "/edges", "/drawn")]
    types += [(t, description) for t, _ in publishers if t.endswith("descriptions")]
    types += [("/image_raw/compressed", "sensor_msgs/CompressedImage"), ("/scan", "a/Scan")]
    found = snapshot(list_graph(publishers, subscribers, types), "/own")
    assert found.nodes == (
        RemoteNode("/camera", ("/image_raw",), (), ()),
        RemoteNode("/edge_detector", ("/edges",), ("/image_raw",), ("/edge_detector",)),
        RemoteNode("/image_view", (), ("/image_raw",), ()),
        RemoteNode("/pipeline", (), (), ("/pipeline/a",)),
        RemoteNode("/rviz_1", ("/drawn",), ("/edges",), ()),
    )
    assert found.compressed == {"/image_raw"}


def test_nodes_come_after_those_whose_topics_they_take_also_in_a_cycle():
    a, b = RemoteNode("/a", ("/1",), ("/2",), ()), RemoteNode("/b", ("/2",), ("/0",), ())
    c = RemoteNode("/c", ("/0",), (), ())
    assert in_order([a, b, c]) == [c, b, a]
    x, y = RemoteNode("/x", ("/1",), ("/2",), ()), RemoteNode("/y", ("/2",), ("/1",), ())
    assert in_order([y, x]) == [x, y]
    alone = RemoteNode("/z", ("/1",), ("/1",), ())
    assert in_order([alone]) == [alone]


def test_nodes_are_found_as_they_come_and_go(runtime, peer):
    assert node(runtime, "plain") is None
    process = peer("plain", "", "/far/image_raw")
    found = wait_for(lambda: node(runtime, "plain"))
    assert found.outputs == {"/far/image_raw": "/far/image_raw"}
    assert runtime.graph.topics["/far/image_raw"].type is Image
    assert vars(runtime.parameters["plain"].current) == {}
    wait_for(lambda: stays(runtime))  # what others left on the graph may still go
    process.terminate()
    wait_for(lambda: node(runtime, "plain") is None)


def stays(runtime):
    """Whether the graph is the same for some looks at it."""
    before = runtime.graph
    time.sleep(1.2)
    return runtime.graph is before


def test_our_nodes_have_their_declared_parameters_and_order(runtime, peer):
    peer("edge_detector", "/plain/image", "/edges_overlay /edges")
    peer("plain", "", "/plain/image")
    wait_for(lambda: node(runtime, "plain") and node(runtime, "edge_detector"))
    names = [node.name for node in runtime.graph.nodes]
    assert names.index("plain") < names.index("edge_detector")
    found = node(runtime, "edge_detector")
    assert found.params == find("edge_detector").params()
    assert list(found.outputs) == ["/edges", "/edges_overlay"]
    assert runtime.graph.topics["/edges_overlay"].on_demand
    assert not runtime.graph.topics["/edges"].on_demand
    runtime.parameters["edge_detector"].update({"low": 12})
    assert rospy.get_param("/edge_detector/low") == 12


def test_a_topic_is_subscribed_only_while_somebody_looks(runtime, peer):
    peer("plain", "", "/plain/image")
    wait_for(lambda: node(runtime, "plain"))
    assert not subscribed("/plain/image")
    first, second = (runtime.subscribe("/plain/image") for _ in range(2))
    image = first.take(PATIENCE_S)
    assert isinstance(image, Image)
    assert image.encoding == "mono8"
    assert image.header.frame_id == "camera_optical"
    assert image.header.stamp_ns % 1_000_000_000 == 5
    assert np.array_equal(image.pixels, np.zeros((2, 3)))
    assert second.take(PATIENCE_S) is not None
    first.close()
    assert subscribed("/plain/image")
    second.close()
    wait_for(lambda: not subscribed("/plain/image"))


def test_topics_of_every_kind_are_shown_and_decoded(runtime, ros_master, tmp_path):
    script = tmp_path / "robot.py"
    script.write_text(ROBOT)
    robot = ros_master.run(sys.executable, str(script))
    types = {
        "/robot/odom": Odometry,
        "/robot/points": PointCloud,
        "/robot/map": OccupancyGrid,
        "/tf": Transforms,
    }
    try:
        wait_for(lambda: set(types) <= set(runtime.graph.topics))
        assert {name: runtime.graph.topics[name].type for name in types} == types
        assert "robot" in [node.name for node in runtime.graph.nodes]
        odometry = runtime.subscribe("/robot/odom", depth=5).take(PATIENCE_S)
        cloud = runtime.subscribe("/robot/points").take(PATIENCE_S)
        [transform] = runtime.subscribe("/tf", depth=5).take(PATIENCE_S).transforms
        grid = runtime.subscribe("/robot/map").take(PATIENCE_S)
    finally:
        end(robot)
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
    assert list(odometry.position_xyz) == [1.5, 0, 0]
    assert np.array_equal(cloud.xyz, [[1, 2, 3], [4, 5, 6]])
    assert grid.cells.tolist() == [[0, 100, -1], [50, 1, 2]]
    assert (transform.header.frame_id, transform.child_frame_id) == ("odom", "base_link")


ROBOT = """
import numpy as np, rospy
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import PointCloud2, PointField
from tf2_msgs.msg import TFMessage
rospy.init_node("robot")
odom = rospy.Publisher("/robot/odom", Odometry, queue_size=1)
points = rospy.Publisher("/robot/points", PointCloud2, queue_size=1)
tf = rospy.Publisher("/tf", TFMessage, queue_size=1)
latched = rospy.Publisher("/robot/map", OccupancyGrid, queue_size=1, latch=True)
grid = OccupancyGrid(data=[0, 100, -1, 50, 1, 2])
grid.info.width, grid.info.height = 3, 2
latched.publish(grid)
here = Odometry(child_frame_id="base_link")
here.header.frame_id, here.pose.pose.position.x = "odom", 1.5
here.pose.pose.orientation.w = 1
cloud = PointCloud2(height=1, width=2, point_step=12, row_step=24, is_dense=True)
cloud.fields = [PointField(name, 4 * i, PointField.FLOAT32, 1) for i, name in enumerate("xyz")]
cloud.data = np.arange(1, 7, dtype=np.float32).tobytes()
cloud.header.frame_id = "base_link"
moved = TransformStamped(child_frame_id="base_link")
moved.header.frame_id, moved.transform.rotation.w = "odom", 1
while not rospy.is_shutdown():
    odom.publish(here)
    points.publish(cloud)
    tf.publish(TFMessage([moved]))
    rospy.sleep(0.05)
"""


def test_a_robot_on_the_parameter_server_is_a_topic(runtime, monkeypatch):
    monkeypatch.setattr("ros_visualise.runtime.ros1.descriptions._AGAIN_S", 0.05)
    topic = "/arm/robot_description"
    rospy.set_param(topic, "<robot name='arm'/>")
    try:
        wait_for(lambda: topic in runtime.graph.topics)
        subscription = runtime.subscribe(topic)
        assert subscription.take(PATIENCE_S).text == "<robot name='arm'/>"
        rospy.set_param(topic, ["no", "text"])
        rospy.set_param(topic, "<robot name='other'/>")
        assert subscription.take(PATIENCE_S).text == "<robot name='other'/>"
        subscription.close()
    finally:
        rospy.delete_param(topic)
    wait_for(lambda: topic not in runtime.graph.topics)


def test_images_come_compressed_where_somebody_publishes_them_so(peer, ros_master):
    pixels = np.full((16, 16), 77, np.uint8)
    packed = RosCompressed(format="mono8; png compressed mono8")
    packed.data = cv2.imencode(".png", pixels)[1].tobytes()
    raw = rospy.Publisher("/packed/image", RosImage, queue_size=1)
    compressed = rospy.Publisher("/packed/image/compressed", RosCompressed, queue_size=1)
    looking = subprocess.Popen(
        [sys.executable, "-c", COMPRESSED], stdout=subprocess.PIPE, text=True
    )
    try:
        wait_for(compressed.get_num_connections)
        while looking.poll() is None:
            compressed.publish(packed)
            time.sleep(0.02)
        assert looking.stdout.read() == "(16, 16) 77\n"
        assert raw.get_num_connections() == 0
    finally:
        looking.kill()
        looking.communicate()
        raw.unregister()
        compressed.unregister()


COMPRESSED = """
import time, rospy
from ros_visualise.runtime.remote.runtime import RemoteRuntime
from ros_visualise.runtime.ros1.transport import Ros1Transport
rospy.init_node("looking")
runtime = RemoteRuntime(Ros1Transport(), compressed=True)
while "/packed/image" not in runtime.graph.topics:
    time.sleep(0.05)
image = runtime.subscribe("/packed/image").take(60)
print(image.pixels.shape, image.pixels.max())
runtime.close()
"""


def test_what_is_received_is_reported_in_the_common_layout(runtime, peer):
    peer("plain", "", "/plain/image")
    wait_for(lambda: node(runtime, "plain"))
    idle = runtime.report(2.0)
    image = TopicReport("sensor_msgs/msg/Image", 0, hz=None, wall_hz=None)
    assert idle.topics["/plain/image"] == image
    assert idle.nodes["plain"].dropped == {}
    assert idle.nodes["plain"].p50_ms is None
    subscription = runtime.subscribe("/plain/image")
    wait_for(lambda: runtime.report(2.0).topics["/plain/image"].messages > 5)
    told = runtime.report().topics["/plain/image"]
    assert told.hz <= 1.0 < told.wall_hz, "the stamps are one second apart, or more"
    subscription.close()


def diagnostics(name, **values):
    told = [KeyValue(key.replace("__", "/"), str(value)) for key, value in values.items()]
    return DiagnosticArray(status=[DiagnosticStatus(name=name, values=told)])


def test_figures_of_a_node_come_from_its_diagnostics(runtime, peer):
    peer("plain", "", "/plain/image")
    wait_for(lambda: node(runtime, "plain"))
    publisher = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=10)
    told = diagnostics("/plain", received=9, dropped__rate=3, dropped__queue=2, p50_ms=1.5, x="-")
    told.status[0].values.append(KeyValue("topics//plain/image/hz", "49.5"))
    told.status[0].values.append(KeyValue("topics//plain/image/wall_hz", "9.9"))
    told.status[0].values.append(KeyValue("p99_ms", "a lot"))
    told.status[0].values.append(KeyValue("processed", "nan"))
    told.status[0].values.append(KeyValue("dropped/late", "9" * 5000))
    told.status[0].values.append(KeyValue("dropped as requested", "rate"))
    wait_for(lambda: publisher.publish(told) or runtime.report().nodes["plain"].received)
    publisher.unregister()
    report = runtime.report(2.0)
    outputs = {"/plain/image": OutputReport(49.5, 9.9)}
    told = NodeReport(9, 0, {"rate": 3, "queue": 2}, p50_ms=1.5, outputs=outputs, gate="rate")
    assert report.nodes["plain"] == told
    assert told.lost == 2
    assert report.topics["/plain/image"].hz == 49.5
    assert report.topics["/plain/image"].wall_hz == 9.9


def test_what_nodes_log_can_be_looked_at(runtime):
    publisher = rospy.Publisher("/rosout", Log, queue_size=10)
    wait_for(lambda: "/rosout" in runtime.diagnostic_topics)
    assert "/rosout" not in runtime.graph.topics
    assert runtime.name == rospy.get_name()
    subscription = runtime.subscribe("/rosout", 100)
    line = Log(level=Log.WARN, name="/planner", msg="no path")

    def told():
        publisher.publish(line)
        found = subscription.take(0.1)
        return found if found and found.node == "/planner" else None

    found = wait_for(told)
    assert (found.level, found.text) == (logging.WARNING, "no path")
    subscription.close()
    publisher.unregister()


def test_nodes_that_share_a_process_are_shown_each_with_its_topics(peer):
    """As the pipeline executable does it: this process plays it, another looks."""
    servers = [
        ReconfigureServer(Parameters(find(name).params()), name)
        for name in ("filters", "edge_detector")
    ]
    publishers = [rospy.Publisher(f"/shared/{name}", RosImage, queue_size=1) for name in "ab"]
    told = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=10)
    looking = subprocess.Popen(
        [sys.executable, "-c", LOOKING], stdout=subprocess.PIPE, text=True, stdin=subprocess.PIPE
    )
    ended = threading.Event()

    def tell():
        while not ended.wait(0.1):
            for name, topic in (("filters", "/shared/a"), ("edge_detector", "/shared/b")):
                array = diagnostics(f"/tests/{name}")
                array.status[0].values.append(KeyValue(f"topics/{topic}/hz", "3.0"))
                if name == "edge_detector":
                    array.status[0].values.append(KeyValue("inputs/image", "/shared/a"))
                told.publish(array)

    thread = threading.Thread(target=tell)
    thread.start()
    try:
        seen, _ = looking.communicate(timeout=120)
    finally:
        ended.set()
        thread.join()
        looking.kill()
        for one in (*servers,):
            one.close()
        for publisher in (*publishers, told):
            publisher.unregister()
    assert seen.split("\n")[:2] == [
        "tests/filters ['/shared/a'] []",
        "tests/edge_detector ['/shared/b'] ['/shared/a']",
    ]


LOOKING = """
import time, rospy
from ros_visualise.runtime.remote.runtime import RemoteRuntime
from ros_visualise.runtime.ros1.transport import Ros1Transport
rospy.init_node("looking")
runtime = RemoteRuntime(Ros1Transport())
end_s = time.monotonic() + 60
while time.monotonic() < end_s:
    shown = [n for n in runtime.graph.nodes if n.name.startswith("tests/")]
    if len(shown) == 2 and all(n.outputs for n in shown):
        break
    time.sleep(0.05)
for node in shown:
    print(node.name, list(node.outputs), list(node.inputs))
runtime.close()
"""


def received(runtime, topic):
    return runtime.report().topics[topic].messages


def test_a_recording_takes_every_topic_in_the_order_of_arrival(runtime, peer, tmp_path):
    from mcap.reader import make_reader

    peer("plain", "", "/plain/a /plain/b /plain/silent_one")
    peer("edge_detector", "/plain/a", "/edges")
    wait_for(lambda: len(runtime.graph.topics) >= 4 and node(runtime, "edge_detector"))
    path = tmp_path / "run.mcap"
    recording = runtime.start_recording(path)
    with pytest.raises(UsageError, match="another process is recording to it"):
        runtime.start_recording(path, overwrite=True)
    topics = ("/plain/a", "/plain/b", "/plain/silent_one", "/edges")
    wait_for(lambda: all(received(runtime, topic) > 5 for topic in topics))
    runtime.parameters["edge_detector"].update({"low": 3})
    written = recording.written
    wait_for(lambda: recording.written > written + 8)
    [(recorded, told)] = runtime.report().recordings.items()
    assert recorded == str(path)
    assert written + 8 < told.messages <= recording.written
    assert told.dropped == 0
    runtime.stop_recording(recording)
    runtime.stop_recording(recording)
    wait_for(lambda: not subscribed("/plain/a"))
    with path.open("rb") as file:
        messages = list(make_reader(file).iter_messages(log_time_order=False))
    by_topic = {}
    for _, channel, message in messages:
        by_topic.setdefault(channel.topic, []).append(message.log_time)
    assert set(by_topic) == {"/plain/a", "/plain/b", "/plain/silent_one", "/edges"} | {
        "/parameter_events"
    }
    assert min(len(by_topic[topic]) for topic in ("/plain/a", "/plain/b", "/edges")) > 3
    times = [message.log_time for _, _, message in messages]
    assert times == sorted(times)
    assert sum(map(len, by_topic.values())) - len(by_topic["/parameter_events"]) == (
        recording.written
    )
    with pytest.raises(OpenError, match="exists"):
        runtime.start_recording(path)


def test_a_silent_topic_holds_up_no_recording_and_stamps_of_zero_are_no_times(runtime, tmp_path):
    start_ns = time.time_ns()
    silent = rospy.Publisher("/silent", RosImage, queue_size=1)
    loud = rospy.Publisher("/loud", RosImage, queue_size=1)
    other = subprocess.Popen([sys.executable, "-c", RECORDING, str(tmp_path / "run.mcap")])
    image = RosImage(height=1, width=1, step=1, encoding="mono8", data=b"x")
    try:
        wait_for(lambda: silent.get_num_connections() and loud.get_num_connections())
        while other.poll() is None:
            loud.publish(image)
            time.sleep(0.01)
        assert other.returncode == 0
        recorded = open_recording(tmp_path / "run.mcap")
        assert start_ns < recorded.start_ns < recorded.end_ns < time.time_ns()
        recorded.close()
    finally:
        other.kill()
        other.wait()
        silent.unregister()
        loud.unregister()


RECORDING = """
import sys, time, rospy
from ros_visualise.runtime.remote.runtime import RemoteRuntime
from ros_visualise.runtime.ros1.transport import Ros1Transport
rospy.init_node("recording")
runtime = RemoteRuntime(Ros1Transport())
while not {"/silent", "/loud"} <= set(runtime.graph.topics):
    time.sleep(0.05)
recording = runtime.start_recording(sys.argv[1])
end_s = time.monotonic() + 60
while recording.written < 10 and time.monotonic() < end_s:
    time.sleep(0.02)
enough = recording.written >= 10
runtime.close()
sys.exit(not enough)
"""

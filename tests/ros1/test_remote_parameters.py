"""The parameters of nodes in other processes: ours, a C++ one, one that dies and comes back."""

import logging
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from enum import Enum

import cv2
import numpy as np
import pytest
import rospy
from dynamic_reconfigure.encoding import encode_config
from dynamic_reconfigure.msg import ConfigDescription, Group, ParamDescription
from ros_graph import PATIENCE_S, wait_for

from ros_visualise.core.errors import OpenError, ParameterError
from ros_visualise.core.params import Parameters, param, specs
from ros_visualise.nodes import find
from ros_visualise.runtime.remote.parameters import RemoteParameters
from ros_visualise.runtime.ros1.reconfigure_client import declare
from ros_visualise.runtime.ros1.reconfigure_server import ReconfigureServer, describe
from ros_visualise.runtime.ros1.transport import Ros1Transport
from ros_visualise.vision.edges import Method

QUIET = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),  # rospy leaves sockets to the collector
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore:notifyAll:DeprecationWarning"),  # rospy's threads
]
pytestmark = [pytest.mark.usefixtures("ros_master"), *QUIET]


SERVING = """
import rospy
from ros_visualise.nodes import find
from ros_visualise.core.params import Parameters
from ros_visualise.runtime.ros1.reconfigure_server import ReconfigureServer
rospy.init_node("edge_detector")
server = ReconfigureServer(Parameters(find("edge_detector").params()))
rospy.spin()
"""


class Blur(Enum):
    OFF = "off"
    BOX = "box"


@dataclass(frozen=True)
class Own:
    count: int = param(5, "a count", min=0, max=800)
    ratio: float = param(1.0, "a ratio", min=0)
    blur: Blur = param(Blur.BOX, "a choice")
    lit: bool = param(True, "a switch", group="more")
    name: str = param("x", "a text", group="more")


@pytest.fixture
def own():
    return Parameters(Own())


@pytest.fixture
def remote(own):
    """Parameters of this process, looked at over ROS."""
    server = ReconfigureServer(own, "far")
    remote = RemoteParameters(Ros1Transport(), f"{rospy.get_name()}/far")
    assert remote.wait(PATIENCE_S)
    yield remote
    remote.close()
    server.close()


def test_a_declaration_is_rebuilt_from_its_description():
    rebuilt = declare(describe(specs(Own)))
    assert rebuilt.node is None
    assert describe(specs(rebuilt.params)) == describe(specs(Own))
    assert {s.name: (s.type, s.min, s.max) for s in specs(rebuilt.params)} == {
        "count": (int, 0, 800),
        "ratio": (float, 0.0, None),
        "lit": (bool, None, None),
        "name": (str, None, None),
        "blur": (specs(rebuilt.params)[2].type, None, None),
    }
    assert {s.name: s.choices for s in specs(rebuilt.params) if s.choices} == {
        "blur": ("off", "box")
    }


@pytest.mark.parametrize("name", ["filters", "edge_detector", "fps_control", "camera", "streamer"])
def test_our_own_nodes_are_known_by_their_description(name):
    found = find(name)
    declaration = declare(describe(specs(found.params)))
    assert declaration.params is found.params
    assert declaration.node == found


def made_in_cpp(edit_method):
    """As a C++ node tells of an int that has names, and of a keyword."""
    parameters = [
        ParamDescription("size", "int", 0, "a size", edit_method),
        ParamDescription("lambda", "double", 0, "a factor", ""),
    ]
    return ConfigDescription(
        groups=[Group(name="Default", parameters=parameters)],
        min=encode_config({"size": 0, "lambda": 0.5}),
        max=encode_config({"size": 3, "lambda": float("inf")}),
        dflt=encode_config({"size": 1, "lambda": 1.0}),
    )


def test_numbers_with_names_are_chosen_by_name_and_sent_as_numbers():
    names = "{'enum_description': 'sizes', 'enum': [{'name': 'Small', 'value': 0, 'type': 'int'},"
    declaration = declare(made_in_cpp(names + " {'name': 'Large', 'value': 1, 'type': 'int'}]}"))
    size, factor = specs(declaration.params)
    assert size.choices == ("Small", "Large")
    assert declaration.params().size.value == "Large"
    sent = declaration.encode((size, factor), {"size": size.coerce("Small"), "lambda_": 2.0})
    assert sent == encode_config({"size": 0, "lambda": 2.0})
    assert declaration.decode(sent) == {"size": "Small", "lambda_": 2.0}


@pytest.mark.parametrize("broken", ["{'enum': [", "7", "{}", "{'enum': [3]}"])
def test_names_that_cannot_be_read_leave_a_number(broken):
    size = specs(declare(made_in_cpp(broken)).params)[0]
    assert (size.type, size.min, size.max) == (int, 0, 3)


def test_what_holds_there_is_seen_here(remote, own):
    current = remote.current
    assert (current.count, current.ratio, current.lit, current.name) == (5, 1.0, True, "x")
    assert current.blur.value == "box"


def test_an_update_is_applied_there_and_here_as_one_whole(remote, own):
    there, here = [], []
    own.on_change(lambda _, changed: there.append(dict(changed)))
    remote.on_change(lambda _, changed: here.append(set(changed)))
    answer = remote.update({"count": 9, "blur": "off", "ratio": 2})
    assert there == [{"count": 9, "blur": Blur.OFF, "ratio": 2.0}]
    assert here == [{"count", "blur", "ratio"}]
    assert answer is remote.current
    assert (answer.count, answer.blur.value) == (9, "off")


def test_whoever_is_told_of_parameters_can_set_them_at_once(own, monkeypatch):
    service = rospy.Service

    def late(*args):
        time.sleep(0.5)
        return service(*args)

    monkeypatch.setattr(rospy, "Service", late)
    remote = RemoteParameters(Ros1Transport(), f"{rospy.get_name()}/late")
    servers = []
    starting = threading.Thread(target=lambda: servers.append(ReconfigureServer(own, "late")))
    starting.start()
    assert remote.wait(PATIENCE_S)
    assert remote.update({"count": 9}).count == 9
    remote.close()
    starting.join()
    servers[0].close()


def test_changes_by_others_are_told(remote, own):
    told = []
    remote.on_change(lambda current, changed: told.append((current.count, dict(changed))))
    own.update({"count": 33})
    wait_for(lambda: told)
    assert told == [(33, {"count": 33})]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [({"count": 900}, "from 0 to 800"), ({"cuont": 1}, "count"), ({"blur": 1}, "off")],
)
def test_a_wrong_value_is_refused_before_it_is_sent(remote, own, wrong, said):
    with pytest.raises(ParameterError, match=said):
        remote.update({"name": "y", **wrong})
    assert own.current == Own()


def test_many_at_once_end_with_the_same_values(remote, own):
    def here():
        for count in range(100):
            remote.update({"count": count})

    def there():
        for number in range(300):
            own.update({"name": str(number)})
            time.sleep(0.001)

    threads = [threading.Thread(target=work) for work in (here, there)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
        assert not thread.is_alive()
    wait_for(lambda: (remote.current.count, remote.current.name) == (99, "299"))
    assert (own.current.count, own.current.name) == (99, "299")


@pytest.fixture
def serve(ros_master):
    """Starts our edge detector's parameters as a node of its own."""
    started = []

    def start():
        started.append(subprocess.Popen([sys.executable, "-c", SERVING]))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.wait()


@pytest.fixture
def edges():
    remote = RemoteParameters(Ros1Transport(), "/edge_detector")
    yield remote
    remote.close()


@pytest.mark.parametrize("by", ["terminate", "kill"])
def test_a_node_that_ends_is_said_once_and_comes_back(serve, edges, caplog, by):
    caplog.set_level(logging.INFO, "ros_visualise")
    process = serve()
    assert edges.wait(PATIENCE_S)
    assert edges.current == find("edge_detector").params()
    edges.update({"low": 7, "method": Method.SOBEL})

    getattr(process, by)()
    process.wait()
    wait_for(lambda: not edges.connected)
    wait_for(lambda: edges.follow() or warned(caplog))
    edges.follow()
    before = edges.current
    start_s = time.monotonic()
    with pytest.raises(OpenError, match="edge_detector does not answer"):
        edges.update({"low": 8})
    assert time.monotonic() - start_s < PATIENCE_S
    assert edges.current is before
    rospy.delete_param("/edge_detector")

    serve()
    wait_for(lambda: edges.connected and edges.current.low == 100)
    edges.follow()
    wait_for(lambda: answers(edges))
    assert edges.current.high == 444
    said = [r.getMessage() for r in caplog.records if r.name.startswith("ros_visualise")]
    lost = "edge_detector: connection lost; will reconnect"
    assert said == [lost, "edge_detector: connected again"]


def warned(caplog):
    return [record for record in caplog.records if record.levelno == logging.WARNING]


def answers(remote):
    try:
        return remote.update({"high": 444})
    except OpenError:
        return False


def test_a_node_that_hangs_holds_nobody_up(serve, edges):
    process = serve()
    assert edges.wait(PATIENCE_S)
    subprocess.run(["kill", "-STOP", str(process.pid)], check=True)
    for low in (1, 2):
        with pytest.raises(OpenError, match="does not answer"):
            edges.update({"low": low})
    subprocess.run(["kill", "-CONT", str(process.pid)], check=True)
    wait_for(lambda: answers(edges))


def test_nobody_there_is_no_hang():
    remote = RemoteParameters(Ros1Transport(), "/nobody")
    assert not remote.wait(0.1)
    with pytest.raises(OpenError, match="nobody does not answer"):
        remote.update({"low": 3})
    remote.close()


def test_a_node_in_cpp_gets_its_declaration(ros_master, tmp_path):
    cv2.imwrite(str(tmp_path / "gray.png"), np.full((48, 64, 3), 100, np.uint8))
    executable = "/usr/lib/image_publisher/image_publisher"
    process = ros_master.run(executable, str(tmp_path / "gray.png"), "__name:=image_publisher")
    remote = RemoteParameters(Ros1Transport(), "/image_publisher")
    try:
        assert remote.wait(PATIENCE_S)
        declared = {spec.name: spec for spec in specs(remote.current)}
        assert declared["publish_rate"].type is float
        assert declared["frame_id"].type is str
        remote.update({"frame_id": "drone", "publish_rate": 5})
        assert rospy.get_param("/image_publisher/frame_id") == "drone"
        assert rospy.get_param("/image_publisher/publish_rate") == 5.0
        with pytest.raises(ParameterError, match=r"from 0.1 to 30"):
            remote.update({"publish_rate": 31})
    finally:
        remote.close()
        process.terminate()
        process.communicate()

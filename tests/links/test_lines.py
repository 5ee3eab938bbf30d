"""Lines to vehicles: TCP and serial ones, shared ones, forged senders, and what is recorded."""

import os
import pty
import select
import socket
import time
from contextlib import closing

import numpy as np
import pytest
from links_ends import PX4, FakeVehicle, free_port, udp_line
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as v2
from waiting import wait_for

from ros_visualise.core.errors import UsageError
from ros_visualise.data import Header, PoseWithCovarianceStamped
from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.graph.vehicles import with_vehicles
from ros_visualise.links import vehicle
from ros_visualise.links.wires import split_system
from ros_visualise.nodes.autopilot import AutopilotLink, AutopilotParams
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.playback import Playback


class Heard:
    """A node `autopilot`, and its last messages."""

    def __init__(self, address, system=0):
        self.params = AutopilotParams(address=address, system=system)
        self.node = AutopilotLink.declared.make(self.params)
        self.last = {}

    def tick(self):
        while (answer := self.node.tick(self.params)) is not None:
            self.last |= answer
        return self.last

    def wait_for(self, port, condition=lambda m: True):
        self.last.pop(port, None)
        wait_for(lambda: port in self.tick() and condition(self.last[port]), port)
        return self.last[port]

    def send_target(self, end, z=-4.0):
        """Send targets until an end was sent one."""
        still, before = np.array([0.0, 0, 0, 1]), len(end.of("LANDING_TARGET"))

        def sent():
            at = Header(time.time_ns(), "base_link")
            pose = PoseWithCovarianceStamped(np.array([0.0, 0, z]), still, np.zeros((6, 6)), at)
            self.node.step(self.params, landing_target=pose)
            return len(end.of("LANDING_TARGET")) > before

        wait_for(sent, "target")


@pytest.fixture
def heard():
    """Makes nodes, which are closed at the end."""
    made = []

    def make(address, system=0):
        made.append(Heard(address, system))
        return made[-1]

    yield make
    for one in made:
        one.node.finish()


@pytest.fixture
def fakes():
    """Makes vehicles, which are closed at the end."""
    made = []

    def make(*args, **settings):
        made.append(FakeVehicle(*args, **settings))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_a_tcp_line_opens_again(heard, fakes):
    with socket.create_server(("127.0.0.1", 0)) as server:
        link = heard(f"tcp://127.0.0.1:{server.getsockname()[1]}")
        line, _ = server.accept()
        line.settimeout(0.02)
        first = fakes(line=line)
        link.wait_for("odom")
        link.send_target(first)
        first.is_quiet = True
        line.shutdown(socket.SHUT_RDWR)
        line, _ = server.accept()
        line.settimeout(0.02)
        second = fakes(line=line)
        link.wait_for("odom")
        link.send_target(second)


class SerialLine:
    """The vehicle's end of a serial line."""

    def __init__(self):
        self._end, other = pty.openpty()
        self.path = os.ttyname(other)

    def send(self, data):
        os.write(self._end, data)

    def recv(self, size):
        if not select.select([self._end], [], [], 0.02)[0]:
            raise TimeoutError
        return os.read(self._end, size)

    def close(self):
        os.close(self._end)


def test_a_serial_line(heard, fakes):
    line = SerialLine()
    link = heard(f"serial://{line.path}:57600")
    end = fakes(line=line)
    np.testing.assert_allclose(link.wait_for("odom").position_xyz, [10, 20, 5])
    link.send_target(end)


def test_two_vehicles_on_one_port(heard, fakes):
    address = f"udp://:{free_port()}"
    port = int(address.rpartition(":")[2])
    first, second = heard(address, 1), heard(address, 2)
    ends = fakes(port, system=1), fakes(port, PX4, 2)
    for link, end, other in ((first, *ends), (second, *ends[::-1])):
        link.wait_for("odom")
        assert link.wait_for("diagnostics").statuses[0].values["system"] == str(end.system)
        before = len(other.of("LANDING_TARGET"))
        link.send_target(end)
        assert len(other.of("LANDING_TARGET")) == before
    first.node.finish()
    second.wait_for("odom")
    second.send_target(ends[1])


def test_a_forged_vehicle_is_ignored_until_the_own_one_is_lost(heard, fakes, monkeypatch, caplog):
    monkeypatch.setattr(vehicle, "_LOST_S", 2.0)
    port = free_port()
    link, own = heard(f"udp://:{port}"), fakes(port)
    link.wait_for("odom")
    forged = v2.MAVLink(None, 1, 1)
    with udp_line(port) as line:
        for message in (
            v2.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3),
            v2.MAVLink_local_position_ned_message(1, 99, 99, 99, 0, 0, 0),
            v2.MAVLink_statustext_message(0, b"forged"),
        ):
            line.send(message.pack(forged))
    wait_for(lambda: "ignoring system 1 at 127.0.0.1" in caplog.text, "warning")
    np.testing.assert_allclose(link.wait_for("odom").position_xyz, [10, 20, 5])
    link.send_target(own)
    assert "text" not in link.last
    assert "armed" in link.last["mode"].text
    own.is_quiet = True
    link.wait_for("mode", lambda m: "lost" in m.text)
    other = fakes(port)  # the same vehicle after a restart, from another port
    link.wait_for("mode", lambda m: "armed" in m.text)
    link.send_target(other)
    assert caplog.text.count("ignoring system 1 at") == 1


def test_what_comes_and_goes_is_recorded_as_a_telemetry_log(tmp_path, fakes):
    port, path = free_port(), tmp_path / "run.tlog"
    graph = with_vehicles(image_pipeline("landscape", size="64x48"), [f"udp://:{port}"])
    runtime = LocalRuntime(graph, Playback(duration_s=1.5))
    runtime.start_recording(path)
    fakes(port)
    try:
        runtime.start()
        assert runtime.wait(60)
    finally:
        runtime.stop()
    with closing(open_recording(path)) as recording:
        places = [m for topic, _, m in recording.read() if topic == "/odom"]
    assert len(places) > 10
    log, kinds = mavutil.mavlink_connection(str(path)), set()
    while (message := log.recv_msg()) is not None:
        kinds.add((message.get_srcComponent(), message.get_type()))
        assert abs(message._timestamp - time.time()) < 60
    log.close()
    assert {(1, "LOCAL_POSITION_NED"), (1, "HEARTBEAT"), (191, "HEARTBEAT")} <= kinds


def test_without_a_vehicle_there_is_no_telemetry_log(tmp_path):
    runtime = LocalRuntime(image_pipeline("landscape"), Playback())
    with pytest.raises(UsageError, match="no MAVLink topic"):
        runtime.start_recording(tmp_path / "run.tlog")
    runtime.stop()


def test_addresses_of_one_of_several_vehicles():
    assert split_system("udp://:14540") == ("udp://:14540", 0)
    assert split_system("udp://:14540?system=2") == ("udp://:14540", 2)
    for wrong in ("0", "256", "-1", "x", "", "2&system=3"):
        with pytest.raises(UsageError, match="must be from 1 to 255"):
            split_system(f"udp://:14540?system={wrong}")
    graph = with_vehicles(
        image_pipeline("camera"), ["udp://:14540?system=1", "udp://:14540?system=2"]
    )
    params = [graph.node(name).params for name in ("autopilot", "autopilot_2")]
    assert [(one.address, one.system) for one in params] == [("udp://:14540", n) for n in (1, 2)]

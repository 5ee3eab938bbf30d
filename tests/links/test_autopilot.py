"""The node autopilot and vehicles that pymavlink speaks for, over UDP."""

import math
import socket
import time
from dataclasses import replace

import numpy as np
import pytest
from links_ends import ARDUPILOT, PX4, FakeVehicle, free_port
from pymavlink.dialects.v20 import ardupilotmega as v2
from waiting import wait_for

from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.data import Header, PoseWithCovarianceStamped
from ros_visualise.geometry import rotations
from ros_visualise.links import vehicle
from ros_visualise.links.mavlink import MavlinkStream
from ros_visualise.links.telemetry import Telemetry
from ros_visualise.links.wires import parse
from ros_visualise.nodes.autopilot import AutopilotLink, AutopilotParams

STILL = np.array([0.0, 0.0, 0.0, 1.0])


class Ends:
    """A node and its vehicles."""

    def __init__(self):
        self.port = free_port()
        self.params = AutopilotParams(address=f"udp://:{self.port}")
        self.heard = {}
        self.open = []

    def start(self, **changes):
        self.params = replace(self.params, **changes)
        self.node = AutopilotLink.declared.make(self.params)
        return self.node

    def vehicle(self, autopilot=PX4, system=1, garbage=b""):
        self.open.append(FakeVehicle(self.port, autopilot, system, garbage))
        return self.open[-1]

    def wait_for(self, port, condition=lambda message: True):
        """The next message of an output."""

        def look():
            found = [one for one in self.tick() if one[0] == port and condition(one[1])]
            return found and found[-1][1]

        return wait_for(look, port)

    def wait_until_known(self):
        return self.wait_for("odom")

    def send(self, vehicle, kind, **messages):
        """Send again and again until the vehicle was sent one of a kind."""
        before = len(vehicle.of(kind))

        def sent():
            self.node.step(self.params, **messages)
            return len(vehicle.of(kind)) > before

        wait_for(sent, kind)
        return vehicle.of(kind)[-1]

    def tick(self):
        """What the node publishes: outputs and messages."""
        found = []
        while (answer := self.node.tick(self.params)) is not None:
            found += answer.items()
        return found

    def close(self):
        for one in self.open:
            one.close()
        self.node.finish()


@pytest.fixture
def ends():
    ends = Ends()
    yield ends
    ends.close()


def pose(at, frame="base_link", age_s=0.0, covariance=None):
    stamp_ns = time.time_ns() - int(age_s * 1e9)
    covariance = np.zeros((6, 6)) if covariance is None else covariance
    return PoseWithCovarianceStamped(
        np.array(at, float), STILL, covariance, Header(stamp_ns, frame)
    )


def test_telemetry_is_in_the_axes_of_ros(ends):
    ends.start()
    ends.vehicle()
    odometry = ends.wait_until_known()
    np.testing.assert_allclose(odometry.position_xyz, [10, 20, 5])
    forward = rotations.to_matrix(odometry.quat_xyzw)[:, 0]
    np.testing.assert_allclose(forward, [1, 0, 0], atol=1e-6)  # heads east
    np.testing.assert_allclose(odometry.linear_xyz, [2, 1, 3], atol=1e-6)
    np.testing.assert_allclose(odometry.angular_xyz, [0.1, -0.2, -0.3], rtol=1e-6)
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
    [transform] = ends.wait_for("tf").transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("odom", "base_link")


def test_absurd_telemetry_is_ignored():
    nan, huge, most = math.nan, 1e30, 2**31 - 1
    messages = [
        v2.MAVLink_attitude_message(1, nan, 0, 0, 0, 0, 0),
        v2.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, huge),
        v2.MAVLink_local_position_ned_message(1, huge, 0, 0, 0, 0, 0),
        v2.MAVLink_global_position_int_message(1, most, 0, 0, 0, 0, 0, 0, 0),
        v2.MAVLink_gps_raw_int_message(1, 3, 0, -most, 0, 80, 120, 10, 0, 14),
        v2.MAVLink_gps_raw_int_message(1, 3, 0, 0, most, 80, 120, 10, 0, 14),
        v2.MAVLink_highres_imu_message(0, nan, 0, 9.8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 63),
        v2.MAVLink_odometry_message(
            0, 1, 12, 0, 0, 0, [1, 0, 0, 0], huge, 0, 0, 0, 0, 0, [nan] * 21, [nan] * 21, 0, 0
        ),
    ]
    own = Telemetry()
    list(own.attitude(v2.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0), 1))
    assert [one.get_type() for one in messages if list(own.take(one, 2))] == []
    assert own.geodetic is own.position_xyz is None
    unknown = v2.MAVLink_gps_raw_int_message(
        1, 3, 0, 0, 0, 80, 120, 10, 0, 14, 0, 2**32 - 1, 2**32 - 1
    )
    ((_, fix),) = own.take(unknown, 2)
    assert fix.covariance_type == 0  # its accuracy is unknown


def test_odometry_of_other_computers_on_board_is_not_the_vehicles(ends):
    ends.start()
    vehicle = ends.vehicle()
    ends.wait_until_known()
    nan, camera = [math.nan] * 21, v2.MAVLink(None, 1, 197)  # MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY
    odometry = v2.MAVLink_odometry_message(
        0, 1, 12, 77, 0, 0, [1, 0, 0, 0], *[0.0] * 6, nan, nan, 0, 0
    )
    text = v2.MAVLink_statustext_message(6, b"from another")
    for message in (odometry, text):
        vehicle._line.send(message.pack(camera))
    found = []

    def heard():
        found.extend(ends.tick())
        return any(name == "text" for name, _ in found)

    wait_for(heard, "text")
    assert {one.position_xyz[1] for name, one in found if name == "odom"} <= {20.0}


def test_mode_clock_and_link_are_shown(ends):
    ends.start()
    ends.vehicle()
    assert ends.wait_for("mode", lambda m: "armed" in m.text).text == "PRECISION LAND, armed"
    [status] = ends.wait_for(
        "diagnostics", lambda m: "clock_offset" in m.statuses[0].values
    ).statuses
    offset_s = float(status.values["clock_offset"].removesuffix(" s"))
    assert 0 < time.time() - offset_s < 300  # since the vehicle was started
    stamp_s = ends.wait_for("odom").header.stamp_ns / 1e9
    assert abs(time.time() - stamp_s) < 3


@pytest.mark.parametrize("frame", ["base_link", "base_link_frd", "odom_ned"])
@pytest.mark.parametrize("autopilot", [PX4, ARDUPILOT])
def test_landing_targets_are_in_the_frame_that_the_autopilot_takes(ends, autopilot, frame):
    """Two metres ahead, one to the left, four below a vehicle that heads east."""
    at = {"base_link": [2, 1, -4], "base_link_frd": [2, -1, 4], "odom_ned": [21, 12, -1]}[frame]
    ends.start()
    autopilot_end = ends.vehicle(autopilot)
    ends.wait_until_known()
    target = ends.send(autopilot_end, "LANDING_TARGET", landing_target=pose(at, frame))
    assert target.position_valid == 1
    if autopilot == PX4:
        assert target.frame == 1  # MAV_FRAME_LOCAL_NED
        np.testing.assert_allclose([target.x, target.y, target.z], [21, 12, -1], atol=1e-5)
    else:
        assert target.frame == 12  # MAV_FRAME_BODY_FRD
        np.testing.assert_allclose([target.x, target.y, target.z], [2, -1, 4], atol=1e-5)
        assert target.distance == pytest.approx(math.sqrt(21))
        assert math.tan(target.angle_x) == pytest.approx(-1 / 4)
        assert math.tan(target.angle_y) == pytest.approx(-2 / 4)
    assert (target.get_srcSystem(), target.get_srcComponent()) == (1, 191)
    heartbeats = wait_for(lambda: autopilot_end.of("HEARTBEAT"), "heartbeat")
    assert (heartbeats[0].type, heartbeats[0].autopilot) == (18, 8)  # an onboard computer


def test_the_pose_goes_with_its_covariance_and_resets(ends):
    covariance = np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    covariance[0, 1] = covariance[1, 0] = 0.5
    ends.start()
    px4 = ends.vehicle(PX4)
    ends.wait_until_known()
    sent = ends.send(px4, "ODOMETRY", pose=pose([1, 2, 3], "map", covariance=covariance))
    assert (sent.frame_id, sent.child_frame_id, sent.estimator_type) == (1, 12, 2)
    np.testing.assert_allclose([sent.x, sent.y, sent.z], [2, 1, -3])
    np.testing.assert_allclose(np.abs(sent.q), [math.sqrt(0.5), 0, 0, math.sqrt(0.5)], atol=1e-6)
    upper = np.zeros((6, 6))
    upper[np.triu_indices(6)] = sent.pose_covariance
    np.testing.assert_allclose(np.diag(upper), [2, 1, 3, 5, 4, 6])
    assert upper[0, 1] == 0.5
    assert math.isnan(sent.velocity_covariance[0])
    assert sent.reset_counter == 0

    def far():  # some of the first pose may come late
        ends.node.step(ends.params, pose=pose([100, 2, 3], "map"))
        return [one for one in px4.of("ODOMETRY") if one.y == 100]

    later = wait_for(lambda: far()[2:], "three of the other pose")
    assert {one.reset_counter for one in later} == {1}


def test_ardupilot_gets_vision_position_estimates(ends):
    ends.start()
    ardupilot = ends.vehicle(ARDUPILOT)
    ends.wait_until_known()
    sent = ends.send(ardupilot, "VISION_POSITION_ESTIMATE", pose=pose([1, 2, 3], "map"))
    np.testing.assert_allclose([sent.x, sent.y, sent.z], [2, 1, -3])
    assert sent.yaw == pytest.approx(math.pi / 2)
    assert len(sent.covariance) == 21
    assert not ardupilot.of("ODOMETRY")


def test_another_autopilot_is_sent_no_guidance(ends, caplog):
    ends.start()
    other = ends.vehicle(autopilot=4)
    ends.wait_until_known()
    for _ in range(3):
        ends.node.step(ends.params, landing_target=pose([1, 1, -3]))
    seen = len(other.of("TIMESYNC"))
    wait_for(lambda: len(other.of("TIMESYNC")) > seen, "a later message")
    assert not other.of("LANDING_TARGET")
    assert caplog.text.count("neither PX4 nor ArduPilot") == 1


def test_stale_targets_are_not_sent(ends):
    ends.start()
    px4 = ends.vehicle()
    ends.wait_until_known()
    ends.node.step(ends.params, landing_target=pose([9, 9, -9], age_s=1))
    sent = ends.send(px4, "LANDING_TARGET", landing_target=pose([0, 0, -4]))
    assert len(px4.of("LANDING_TARGET")) == 1
    assert sent.z == pytest.approx(-1)
    assert ends.node.report()["stale"] == 1

    def texts():
        ends.tick()
        return [one.text for one in px4.of("STATUSTEXT")]

    wait_for(lambda: len(texts()) == 2, "both texts")
    assert texts() == ["landing target found", "landing target lost"]


def test_telemetry_that_does_not_come_is_asked_for(ends, monkeypatch):
    monkeypatch.setattr(vehicle, "_SPEAK_S", 0.05)
    ends.start()
    ardupilot = ends.vehicle(ARDUPILOT)
    ardupilot.is_mute = True
    ends.wait_for("mode")
    asked = wait_for(lambda: ardupilot.of("COMMAND_LONG")[:3], "requests")
    assert {one.command for one in asked} == {511}
    assert {one.param1: one.param2 for one in asked}[32] == pytest.approx(1e6 / 30)
    ends.tick()
    wait_for(lambda: len(ardupilot.of("COMMAND_LONG")) >= 15, "all requests")
    seen = len(ardupilot.of("HEARTBEAT"))
    wait_for(lambda: len(ardupilot.of("HEARTBEAT")) > seen + 2, "later messages")
    assert len(ardupilot.of("COMMAND_LONG")) == 15


def test_nothing_commands_the_vehicle(ends):
    ends.start()
    px4 = ends.vehicle()
    ends.wait_until_known()
    ends.send(px4, "LANDING_TARGET", landing_target=pose([0, 0, -4]))
    kinds = {one.get_type() for one in px4.heard}
    assert kinds <= {"HEARTBEAT", "TIMESYNC", "LANDING_TARGET", "STATUSTEXT"}


def test_damaged_frames_cost_only_themselves(ends):
    ends.start()
    ends.vehicle(garbage=b"\xfd\x09garbage\xfe")
    ends.wait_until_known()
    ends.wait_until_known()
    assert ends.node.report()["damaged_bytes"] >= 10


def test_a_line_goes_on_after_any_damage(ends):
    ends.start()
    sender = ends.vehicle()._mav
    frames = [
        v2.MAVLink_local_position_ned_message(n, n, 0, 0, 0, 0, 0).pack(sender) for n in range(200)
    ]
    data = bytearray(b"".join(frames))
    for place in np.random.default_rng(0).integers(0, len(data), 20):
        data[place] ^= 0x55
    for size in (1, 7, 1000):
        stream, found = MavlinkStream(), []
        for start in range(0, len(data), size):
            found += stream.feed(bytes(data[start : start + size]), is_datagram=False)
        assert 175 <= len(found) <= 190
        assert [one.x for one in found] == sorted(one.x for one in found)
        assert stream.damaged > 20


def test_a_lost_link_is_said_and_comes_back(ends, caplog, monkeypatch):
    monkeypatch.setattr(vehicle, "_LOST_S", 0.7)
    ends.start()
    px4 = ends.vehicle()
    ends.wait_until_known()
    px4.is_quiet = True
    assert ends.wait_for("mode", lambda m: "lost" in m.text).text == "link to system 1 lost"
    ends.node.step(ends.params, landing_target=pose([0, 0, -4]))
    px4.is_quiet = False
    ends.wait_for("mode", lambda m: "armed" in m.text)
    assert not px4.of("LANDING_TARGET")
    assert caplog.text.count("no heartbeat of system 1") == 1


def test_of_several_vehicles_one_is_followed(ends, caplog):
    ends.start(system=2)
    first, second = ends.vehicle(ARDUPILOT, system=1), ends.vehicle(PX4, system=2)
    ends.wait_until_known()
    sent = ends.send(second, "LANDING_TARGET", landing_target=pose([0, 0, -4]))
    assert sent.frame == 1
    assert not first.of("LANDING_TARGET")
    assert caplog.text.count("ignoring system 1") == 1


def test_addresses():
    assert parse("udp://:14540") == ("udp", "127.0.0.1", 14540)
    assert parse("udp://0.0.0.0:14540") == ("udp", "0.0.0.0", 14540)
    assert parse("tcp://localhost:5760") == ("tcp", "localhost", 5760)
    assert parse("serial:///dev/ttyACM0:57600") == ("serial", "/dev/ttyACM0", 57600)
    for wrong in (
        "",
        "udp",
        "udp://",
        "tcp://:1",
        "udp://x:99999",
        "serial:///dev/tty",
        "http://x:1",
    ):
        with pytest.raises(UsageError, match="not the address of a vehicle"):
            parse(wrong)


def test_a_port_in_use_is_said():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        with pytest.raises(OpenError, match="in use"):
            AutopilotLink(AutopilotParams(address=f"udp://:{one.getsockname()[1]}"))

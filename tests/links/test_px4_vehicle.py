"""A simulated vehicle that answers as a PX4, and a ground station by pymavlink, over UDP."""

import math
import struct

import numpy as np
import pytest
from links_ends import Flyer, Station
from pymavlink.dialects.v20 import ardupilotmega as v2

from ros_visualise.data import Header, NavSatFix
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.nodes.mavlink_vehicle import MavlinkVehicle, MavlinkVehicleParams

ARM, DISARM, TAKE_OFF, LAND, HOME, SET_MODE, REPOSITION = 400, 400, 22, 21, 20, 176, 192
OFFBOARD, PRECISION_LAND = (1, 6, 0), (1, 4, 9)
ACCEPTED, DENIED, UNSUPPORTED = 0, 2, 3
NAN = math.nan


@pytest.fixture
def ends():
    """A vehicle on the ground, and a ground station that knows it."""
    station = Station()
    params = MavlinkVehicleParams(address=f"udpout://127.0.0.1:{station.port}")
    node = MavlinkVehicle.declared.make(params)
    flyer = Flyer(node, params)
    station.wait("HEARTBEAT")
    yield flyer, station
    node.finish()
    station.close()


def risen(flyer, station):
    station.hush()
    flyer.fly(0.1)
    assert station.command(ARM, 1) == ACCEPTED
    assert station.command(TAKE_OFF, 0, 0, 0, NAN, NAN, NAN, NAN) == ACCEPTED
    assert flyer.fly(10, lambda: flyer.modes[-1] == "hold, armed")
    return flyer, station


def test_it_is_found_as_a_px4_with_its_telemetry(ends):
    flyer, station = ends
    beat = station.wait("HEARTBEAT")
    assert (beat.autopilot, beat.type, beat.base_mode & 128) == (12, 2, 0)
    flyer.node.step(
        flyer.params, fix=NavSatFix(49.0, 8.4, 116.0, header=Header(0)), frames=FrameTree()
    )
    flyer.at[:] = 20, 10, 0
    flyer.fly(1)
    local = station.wait("LOCAL_POSITION_NED")
    np.testing.assert_allclose([local.x, local.y, local.z], [10, 20, 0], atol=1e-5)
    assert station.wait("ATTITUDE").yaw == pytest.approx(math.pi / 2)  # x, its front, is east
    place = station.wait("GLOBAL_POSITION_INT")
    assert (place.lat, place.lon, place.alt) == (490000000, 84000000, 116000)
    assert station.wait("EXTENDED_SYS_STATE").landed_state == 1


def test_parameters_and_missions_are_answered(ends):
    _, station = ends
    station.send(v2.MAVLink_param_request_list_message(1, 1))
    last = station.wait("PARAM_VALUE", lambda m: m.param_index == m.param_count - 1)
    got = {m.param_id for m in station.heard if m.get_type() == "PARAM_VALUE"}
    assert len(got) == last.param_count > 15
    station.send(v2.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", 4.0, 9))
    assert station.wait("PARAM_VALUE").param_value == 4.0
    four = struct.unpack("<f", struct.pack("<i", 4))[0]
    station.send(v2.MAVLink_param_set_message(1, 1, b"COM_OBL_RC_ACT", four, 6))
    station.send(v2.MAVLink_param_request_read_message(1, 1, b"COM_OBL_RC_ACT", -1))
    [*_, answer] = [station.wait("PARAM_VALUE") for _ in range(2)]
    assert struct.pack("<f", answer.param_value) == struct.pack("<i", 4)
    for wrong in (NAN, math.inf, -1.0):
        station.send(v2.MAVLink_param_set_message(1, 1, b"MIS_TAKEOFF_ALT", wrong, 9))
        assert station.wait("PARAM_VALUE").param_value == 4.0
    for kind in range(3):
        station.send(v2.MAVLink_mission_request_list_message(1, 1, kind))
        assert station.wait("MISSION_COUNT").count == 0
    station.send(v2.MAVLink_mission_count_message(1, 1, 3))
    assert station.wait("MISSION_ACK").type == 3  # unsupported
    assert station.command(520) == ACCEPTED
    assert station.wait("AUTOPILOT_VERSION").capabilities & 8192
    assert station.command(31000) == UNSUPPORTED


def test_it_takes_off_flies_lands_and_disarms(ends):
    flyer, station = risen(*ends)
    assert flyer.at[2] == pytest.approx(2.5, abs=0.6)
    flyer.fly(3)
    assert station.command(DISARM, 0) == DENIED
    station.set_point(velocity=(0, 2, 0))
    assert station.command(SET_MODE, *OFFBOARD) == ACCEPTED
    flyer.fly(0.9)
    assert flyer.velocity[0] == pytest.approx(2, abs=0.1)  # east
    for _ in range(12):
        station.set_point(position=(3, 4, -3), yaw=0.0)
        flyer.fly(0.9)
    np.testing.assert_allclose(flyer.ned, [3, 4, -3], atol=0.05)
    assert flyer.yaw == pytest.approx(math.pi / 2, abs=0.01)  # north
    station.set_point(velocity=(1, 0, 0), frame=8)  # forward
    flyer.fly(0.9)
    assert flyer.velocity[1] == pytest.approx(1, abs=0.1)
    assert station.command(LAND) == ACCEPTED
    assert flyer.fly(20, lambda: flyer.modes[-1] == "land, disarmed")
    assert flyer.at[2] == 0


@pytest.mark.parametrize(("action", "mode"), [(5, "hold, armed"), (4, "land, armed")])
def test_without_set_points_it_falls_back_as_the_parameter_says(ends, action, mode):
    flyer, station = risen(*ends)
    assert station.command(SET_MODE, *OFFBOARD) == DENIED
    value = struct.unpack("<f", struct.pack("<i", action))[0]
    station.send(v2.MAVLink_param_set_message(1, 1, b"COM_OBL_RC_ACT", value, 6))
    station.set_point(velocity=(2, 0, 0))
    assert station.command(SET_MODE, *OFFBOARD) == ACCEPTED
    assert not flyer.fly(0.9, lambda: flyer.modes[-1] == mode)
    assert flyer.fly(0.3, lambda: flyer.modes[-1] == mode)
    station.catch_up()
    assert any("setpoints lost" in text for text in station.texts())
    flyer.fly(2)
    assert np.linalg.norm(flyer.velocity[:2]) < 0.2


def test_it_lands_on_the_target_that_it_is_sent(ends):
    flyer, station = risen(*ends)
    pad = np.array([1.5, -1.0, 0.0])
    assert station.command(SET_MODE, *PRECISION_LAND) == ACCEPTED

    def landed():
        return flyer.modes[-1] == "precision land, disarmed"

    for _ in range(300):
        station.target(pad.tolist())
        if flyer.fly(0.1, landed):
            break
    assert landed()
    assert np.linalg.norm(flyer.ned - pad) < 0.1


def test_without_a_target_it_searches_and_then_lands_where_it_is(ends):
    flyer, station = risen(*ends)
    station.target([5.0, 5.0, 0.0], frame=12)  # the frame of another autopilot
    assert station.command(SET_MODE, *PRECISION_LAND) == ACCEPTED
    flyer.fly(8)
    assert flyer.at[2] > 8
    assert flyer.fly(60, lambda: flyer.modes[-1] == "precision land, disarmed")
    station.catch_up()
    assert {"landing target: frame 12 unsupported", "Landing target not found; landing here"} <= {
        *station.texts()
    }


def test_it_is_disarmed_when_the_simulation_starts_over(ends):
    flyer, station = risen(*ends)
    flyer.node.reset()
    flyer.at[:], flyer.velocity[:] = 0, 0
    flyer.fly(1)
    assert flyer.modes[-1] == "hold, disarmed"
    assert flyer.at[2] < 0.05
    risen(flyer, station)


def test_what_cannot_be_is_denied(ends):
    flyer, station = ends
    station.hush()
    assert station.command(ARM, 1) == DENIED  # no position yet
    flyer.fly(0.1)
    assert station.command(REPOSITION, -1, 0, 0, 0, 49, 8.4, 200) == DENIED
    assert station.command(SET_MODE, 1, 3, 0) == DENIED  # no remote control
    assert station.command(SET_MODE, 1, NAN, NAN) == DENIED
    assert station.command(ARM, 1) == ACCEPTED
    assert flyer.fly(11, lambda: flyer.modes[-1] == "hold, disarmed")  # it did not take off


def test_garbage_and_messages_for_others_change_nothing(ends):
    flyer, station = risen(*ends)
    before = flyer.ned
    for data in (b"\xfd\xff", b"\xfe" * 300, bytes(range(256))):
        station.send(data)
    station.send(v2.MAVLink_command_long_message(7, 1, 400, 0, 0, 21196, 0, 0, 0, 0, 0))
    message = v2.MAVLink_set_position_target_local_ned_message
    for frame, values in ((1, [NAN] * 6), (1, [math.inf] * 6), (99, [9.0] * 6)):
        station.send(message(0, 1, 1, frame, 0, *values, 0, 0, 0, 0, 0))
    station.target([NAN, 0, 0])
    assert station.command(SET_MODE, *OFFBOARD) == DENIED
    flyer.fly(3)
    assert flyer.modes[-1] == "hold, armed"
    assert np.linalg.norm(flyer.ned - before) < 1

"""A simulated vehicle and MAVSDK as its ground station, which has a codec of its own."""

import math
import threading

import pytest
from links_ends import Flyer, free_port
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action.action import Action
from mavsdk.plugins.mission.mission import Mission
from mavsdk.plugins.offboard.offboard import Offboard, PositionNedYaw
from mavsdk.plugins.param.param import Param
from mavsdk.plugins.telemetry.telemetry import Telemetry
from waiting import wait_for

from ros_visualise.data import Header, NavSatFix
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.nodes.mavlink_vehicle import MavlinkVehicle, MavlinkVehicleParams


@pytest.fixture
def station():
    """MAVSDK, and the vehicle that it found, which flies four times as fast as time passes."""
    port = free_port()
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    mavsdk.add_any_connection(f"udpin://127.0.0.1:{port}")
    params = MavlinkVehicleParams(address=f"udpout://127.0.0.1:{port}")
    node = MavlinkVehicle.declared.make(params)
    flyer, landed = Flyer(node, params), threading.Event()
    fix = NavSatFix(49.0, 8.4, 116.0, header=Header(0))
    node.step(params, fix=fix, frames=FrameTree())

    def fly():
        while not landed.wait(0.02):
            flyer.fly(0.08)

    thread = threading.Thread(target=fly)
    thread.start()
    yield mavsdk.first_autopilot(30)
    landed.set()
    thread.join()
    mavsdk.destroy()
    node.finish()


def test_it_flies_it(station):
    telemetry, action, offboard = Telemetry(station), Action(station), Offboard(station)
    parameters = Param(station)
    wait_for(telemetry.health_all_ok, "health")
    assert parameters.get_param_int("COM_OBL_RC_ACT") == 5
    action.set_takeoff_altitude(3.0)
    assert action.get_takeoff_altitude() == 3.0
    assert Mission(station).download_mission().mission_items == []
    action.arm()
    action.takeoff()
    wait_for(lambda: telemetry.position().relative_altitude_m > 2.5, "take-off")
    assert telemetry.in_air()
    offboard.set_position_ned(PositionNedYaw(2.0, 1.0, -4.0, 90.0))
    offboard.start()

    def arrived():
        place = telemetry.position_velocity_ned().position
        return math.dist((place.north_m, place.east_m, place.down_m), (2, 1, -4)) < 0.3

    wait_for(arrived, "the place")
    offboard.stop()
    action.land()
    wait_for(lambda: not telemetry.armed(), "landing")
    assert not telemetry.in_air()

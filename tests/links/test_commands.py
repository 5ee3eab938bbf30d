"""Commands to vehicles: refused unless permitted, in the way that each autopilot takes them."""

import math
import time

import numpy as np
import pytest
from links_ends import ARDUPILOT, PX4, FakeVehicle, Flyer, free_port
from pymavlink.dialects.v20 import ardupilotmega as v2
from waiting import wait_for

from ros_visualise.core.errors import UsageError
from ros_visualise.data import Header, NavSatFix
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.links import commands, vehicle
from ros_visualise.nodes.autopilot import AutopilotLink, AutopilotParams
from ros_visualise.nodes.mavlink_vehicle import MavlinkVehicle, MavlinkVehicleParams

ACTIONS = ("take_off", "land", "go_to", "return_home", "hold")


class Link:
    """The node `autopilot`, and what it published."""

    def __init__(self, **settings):
        self.port = free_port()
        self.params = AutopilotParams(address=f"udp://:{self.port}", **settings)
        self.node = AutopilotLink.declared.make(self.params)
        self.texts, self.modes = [], []

    def tick(self):
        while (answer := self.node.tick(self.params)) is not None:
            self.texts += [one.text for port, one in answer.items() if port == "text"]
            self.modes += [one.text for port, one in answer.items() if port == "mode"]
        return True

    def wait_for_text(self, text):
        wait_for(lambda: self.tick() and any(text in one for one in self.texts), text)


@pytest.fixture
def permitted():
    commands.permit(True)
    yield
    commands.permit(False)


@pytest.fixture
def link():
    link = Link(goal_x=3.0, goal_y=2.0, goal_z=6.0, take_off_height=4.0)
    yield link
    link.node.finish()


@pytest.fixture
def fake(link):
    """Makes a vehicle that answers commands, and waits until it is known."""
    made = []

    def make(autopilot):
        made.append(FakeVehicle(link.port, autopilot))
        wait_for(lambda: link.tick() and link.modes and "armed" in link.modes[-1], "vehicle")
        return made[-1]

    yield make
    for one in made:
        one.close()


def sent(vehicle):
    """The commands that it was sent, without repetitions and requests for telemetry."""
    first = [one for one in vehicle.of("COMMAND_LONG") if not one.confirmation]
    return [one for one in first if one.command != 511] + vehicle.of("COMMAND_INT")[:1]


def test_nothing_is_commanded_unless_permitted(link, fake):
    vehicle = fake(PX4)
    for name in ACTIONS:
        with pytest.raises(UsageError, match="--allow-control"):
            getattr(link.node, name)()
    seen = len(vehicle.of("TIMESYNC"))
    wait_for(lambda: len(vehicle.of("TIMESYNC")) > seen, "a later message")
    assert not sent(vehicle)


def test_without_a_vehicle_it_is_refused_with_the_reason(link, permitted):
    for name in ACTIONS:
        with pytest.raises(UsageError, match="no vehicle on udp://"):
            getattr(link.node, name)()


def test_another_autopilot_is_not_commanded(link, fake, permitted):
    fake(4)
    with pytest.raises(UsageError, match="neither PX4 nor ArduPilot"):
        link.node.take_off()


def test_ardupilot_is_commanded_by_its_modes(link, fake, permitted):
    vehicle = fake(ARDUPILOT)
    with pytest.raises(UsageError, match="no global position"):
        link.node.go_to()
    vehicle.send(
        v2.MAVLink_global_position_int_message(0, 490000000, 84000000, 120000, 0, 0, 0, 0, 0)
    )
    wait_for(lambda: link.tick() and link.node._vehicle.telemetry.geodetic is not None, "position")
    for name, text in (("take_off", "take-off: accepted"), ("go_to", "go to: accepted")):
        getattr(link.node, name)()
        link.wait_for_text(text)
    mode, arm, rise, again, there = sent(vehicle)
    assert (
        (mode.command, mode.param1, mode.param2) == (176, 1, 4) == (again.command, 1, again.param2)
    )
    assert (arm.command, arm.param1, arm.param2) == (400, 1, 0)  # not by force
    assert (rise.command, rise.param7) == (22, 4)
    # from 10 m east, 20 m north, 5 m up of the origin of odom to 3, 2, 6
    assert (there.command, there.frame, there.z) == (192, 0, pytest.approx(121, abs=0.01))
    assert there.x == pytest.approx(490000000 - 18 / 111_210 * 1e7, abs=20)
    assert there.y == pytest.approx(84000000 - 7 / 73_100 * 1e7, abs=20)
    for name, text in (("hold", "hold: accepted"), ("land", "landing: accepted")):
        getattr(link.node, name)()
        link.wait_for_text(text)
    assert [one.param2 for one in sent(vehicle)[-3:-1]] == [17, 9]


def test_a_refusal_and_silence_are_reported(link, fake, permitted, monkeypatch):
    monkeypatch.setattr(commands, "_AGAIN_S", 0.1)
    monkeypatch.setattr(vehicle, "_SPEAK_S", 0.1)
    px4 = fake(PX4)
    px4.results = {400: 1, 20: None}
    link.node.take_off()
    link.wait_for_text("take-off failed: MAV_CMD_COMPONENT_ARM_DISARM: temporarily rejected")
    assert [one.command for one in sent(px4)] == [400]
    link.node.return_home()
    link.wait_for_text("return failed: MAV_CMD_NAV_RETURN_TO_LAUNCH: no answer")
    tries = [one.confirmation for one in px4.of("COMMAND_LONG") if one.command == 20]
    assert tries == [0, 1, 2, 3, 4]


def test_a_vehicle_is_flown(link, permitted):
    params = MavlinkVehicleParams(address=f"udpout://127.0.0.1:{link.port}")
    flyer = Flyer(MavlinkVehicle.declared.make(params), params)
    fix = NavSatFix(49.0, 8.4, 116.0, header=Header(0))
    flyer.node.step(params, fix=fix, frames=FrameTree())

    def flies(condition, what):
        def look():
            flyer.fly(0.1)
            time.sleep(0.005)  # four to twenty times as fast as time passes
            return link.tick() and condition()

        wait_for(look, what, sleep=lambda _: None)

    flies(lambda: link.node._vehicle.telemetry.geodetic is not None and link.modes, "vehicle")
    link.node.take_off()
    flies(lambda: abs(flyer.at[2] - 4) < 0.2, "take-off")
    flies(lambda: link.modes[-1] == "LOITER, armed", "hold")
    link.node.go_to()
    flies(lambda: math.dist(flyer.at, (3, 2, 6)) < 0.3, "the place")
    link.node.return_home()
    flies(lambda: link.modes[-1].endswith("disarmed"), "landing")
    assert np.hypot(*flyer.at[:2]) < 0.5
    flyer.node.finish()

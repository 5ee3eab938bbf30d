"""A simulated vehicle without GPS, which navigates by the poses that it is sent over UDP."""

import math

import numpy as np
import pytest
from links_ends import Flyer, Station
from pymavlink.dialects.v20 import ardupilotmega as v2

from ros_visualise.links.px4_modes import PARAMETERS
from ros_visualise.links.px4_vision import VisionAid, VisionPose
from ros_visualise.nodes.mavlink_vehicle import MavlinkVehicle, MavlinkVehicleParams

ARM, TAKE_OFF, LAND, SET_MODE = 400, 22, 21, 176
ACCEPTED, DENIED = 0, 2
NAN = math.nan


class Blind:
    """A vehicle without GPS, and a companion that sends it its true position."""

    def __init__(self):
        self.station = Station()
        params = MavlinkVehicleParams(address=f"udpout://127.0.0.1:{self.station.port}", gps=False)
        self.node = MavlinkVehicle.declared.make(params)
        self.flyer = Flyer(self.node, params, start=(3.0, 4.0, 0.0))
        self.station.wait("HEARTBEAT")
        self.flyer.fly(0.1)
        self.station.hush()
        self._us = 1

    def tell(self, off=(0, 0, 0), resets=0, covariance=0.01, frame=1, as_vision=False):
        """Send a pose: the true one, shifted north, east, down."""
        self._us += 100_000
        x, y, z = self.flyer.ned + off
        yaw = math.pi / 2 - self.flyer.yaw
        several = np.diag([covariance] * 6)[np.triu_indices(6)].tolist()
        if as_vision:
            make = v2.MAVLink_vision_position_estimate_message
            self.station.send(make(self._us, x, y, z, 0, 0, yaw, several, resets))
        else:
            quat = [math.cos(yaw / 2), 0, 0, math.sin(yaw / 2)]
            make, none = v2.MAVLink_odometry_message, [NAN] * 6
            several = several, [NAN] * 21
            self.station.send(make(self._us, frame, 12, x, y, z, quat, *none, *several, resets, 2))
        self.station.catch_up()

    def fly(self, seconds, drift=(0, 0, 0), until=lambda: False, **more):
        """Fly while poses come ten times a second; its odometry drifts at some speed."""
        for _ in range(round(seconds / 0.1)):
            self.tell(**more)
            self.flyer.drift += 0.1 * np.array(drift)
            if self.flyer.fly(0.1, until):
                return True
        return False

    def rise(self):
        self.tell()
        assert self.station.command(ARM, 1) == ACCEPTED
        assert self.station.command(TAKE_OFF, 0, 0, 0, NAN, NAN, NAN, NAN) == ACCEPTED
        assert self.fly(10, until=lambda: self.flyer.modes[-1] == "hold, armed")
        self.fly(3)

    def close(self):
        self.node.finish()
        self.station.close()


@pytest.fixture
def blind():
    one = Blind()
    yield one
    one.close()


@pytest.mark.parametrize("as_vision", [False, True])
def test_it_arms_by_vision_alone_and_its_drift_is_corrected(blind, as_vision):
    assert blind.station.command(ARM, 1) == DENIED
    blind.tell(frame=12)
    assert blind.station.command(ARM, 1) == DENIED
    assert any("frame 12 unsupported" in text for text in blind.station.texts())
    blind.rise()
    held = blind.flyer.at.copy()
    blind.fly(10, drift=(0.1, -0.1, 0), as_vision=as_vision)
    assert np.abs(blind.flyer.drift[:2]).min() > 0.9
    np.testing.assert_allclose(blind.flyer.at, held, atol=0.2)


def test_a_jump_is_rejected_until_it_is_announced_or_lasts(blind):
    blind.rise()
    held = blind.flyer.at.copy()
    blind.fly(1, off=(3, 0, 0))
    assert any("rejected" in text for text in blind.station.texts())
    np.testing.assert_allclose(blind.flyer.at, held, atol=0.15)
    blind.fly(1)
    for more in ({"off": (3, 0, 0), "resets": 1}, {"off": (0, -4, 0), "resets": 1}):
        blind.fly(5, **more)  # the second one is not announced, but lasts
        np.testing.assert_allclose(blind.flyer.at, held, atol=0.2)
        assert any("Reset to vision" in text for text in blind.station.texts())
        number = v2.MAVLINK_MSG_ID_LOCAL_POSITION_NED
        blind.station.send(v2.MAVLink_command_long_message(1, 1, 512, 0, number, *[0] * 6))
        place = blind.station.wait("LOCAL_POSITION_NED")
        np.testing.assert_allclose(
            [place.x, place.y], (blind.flyer.ned + more["off"])[:2], atol=0.2
        )


def test_without_vision_it_says_so_and_lands(blind):
    blind.rise()
    assert not blind.flyer.fly(4.5, lambda: blind.flyer.modes[-1] == "land, armed")
    assert blind.flyer.fly(1, lambda: blind.flyer.modes[-1] == "land, armed")
    blind.station.catch_up()
    assert any("Vision position timeout" in text for text in blind.station.texts())
    assert any("position lost; mode land" in text for text in blind.station.texts())
    assert blind.station.command(SET_MODE, 1, 4, 3) == DENIED  # hold
    assert blind.station.command(LAND) == ACCEPTED
    assert blind.flyer.fly(15, lambda: blind.flyer.modes[-1] == "land, disarmed")


def pose(x=0.0, variance=0.01, stamp_us=1, **more):
    covariance = np.diag([variance] * 6)[np.triu_indices(6)]
    values = {"yaw": 0.0, "resets": 0} | more
    return VisionPose(np.array([x, 0, 0]), covariance=covariance, stamp_us=stamp_us, **values)


def aid():
    texts = []
    one = VisionAid(dict(PARAMETERS), texts.append)
    one.follow(1.0, np.zeros(3), 0.0)
    assert one.fuse(pose(stamp_us=3_000_000))
    return one, texts


@pytest.mark.parametrize("variance", [0.0, -1.0, NAN, math.inf])
def test_impossible_covariances_are_replaced_by_the_noise_of_the_parameters(variance):
    one, _ = aid()
    one.follow(1.1, np.zeros(3), 0.0)
    one.fuse(pose(0.1, variance, stamp_us=3_100_000))
    assert 0.03 < one.here[0] < 0.08
    assert (one.variances > 0).all()


def test_old_repeated_and_broken_poses_are_ignored():
    one, _ = aid()
    for bad in (pose(0.2, stamp_us=3_000_000), pose(0.2, stamp_us=2_900_000), pose(NAN)):
        assert not one.fuse(bad)
    assert not one.fuse(pose(0.2, stamp_us=4_000_000, yaw=NAN))
    assert one.here.tolist() == [0, 0, 0]
    one.fuse(pose(0.2, stamp_us=10))  # its clock started over
    assert one.here[0] > 0


def test_a_wrong_heading_alone_is_not_fused():
    one, _ = aid()
    one.follow(1.1, np.zeros(3), 0.0)
    one.fuse(pose(0.1, stamp_us=4_000_000, yaw=1.5))
    assert one.yaw == 0
    assert one.here[0] > 0


def test_the_delay_of_poses_is_taken_off():
    one, _ = aid()
    one._p["EKF2_EV_DELAY"] = 200.0
    for k in range(11):
        one.follow(1 + 0.1 * k, np.array([0.1 * k, 0, 0]), 0.0)
    one.fuse(pose(0.8, stamp_us=4_000_000))
    assert one.here[0] == pytest.approx(1.0, abs=1e-9)

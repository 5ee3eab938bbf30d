"""A vehicle that MAVSDK speaks for, which reads what it is sent by a codec of its own."""

import json
import math
import time

import numpy as np
import pytest
from links_ends import PX4, free_port
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.mavlink_direct_server.mavlink_direct_server import (
    MavlinkDirectServer,
    MavlinkMessage,
)
from waiting import wait_for

from ros_visualise.data import Header, PoseWithCovarianceStamped
from ros_visualise.nodes.autopilot import AutopilotLink, AutopilotParams


@pytest.fixture
def ends():
    """The node, and MAVSDK as an autopilot."""
    port = free_port()
    params = AutopilotParams(address=f"udp://:{port}")
    node = AutopilotLink.declared.make(params)
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.AUTOPILOT))
    mavsdk.add_any_connection(f"udpout://127.0.0.1:{port}")
    yield node, params, MavlinkDirectServer(mavsdk.server_component())
    mavsdk.destroy()
    node.finish()


def test_it_reads_what_it_is_sent_and_is_read(ends):
    node, params, server = ends
    heard, published = {}, {}
    for kind in ("LANDING_TARGET", "ODOMETRY", "HEARTBEAT"):
        server.subscribe_message(kind, lambda one, *_: heard.setdefault(one.message_name, one))

    def send(kind, **fields):
        server.send_message(MavlinkMessage(kind, 1, 1, 0, 0, json.dumps(fields)))

    def exchange():
        common = {"base_mode": 128, "custom_mode": 3 << 16, "system_status": 4}
        send("HEARTBEAT", type=2, autopilot=PX4, mavlink_version=3, **common)
        send("ATTITUDE", time_boot_ms=0, roll=0, pitch=0, yaw=math.pi / 2)
        send("LOCAL_POSITION_NED", time_boot_ms=0, x=20, y=10, z=-5, vx=0, vy=0, vz=0)
        while (answer := node.tick(params)) is not None:
            published.update(answer)
        at = Header(time.time_ns(), "base_link")
        still = np.array([0.0, 0.0, 0.0, 1.0])
        pose = PoseWithCovarianceStamped(np.array([2.0, 1, -4]), still, np.eye(6), at)
        node.step(params, landing_target=pose)
        node.step(params, pose=pose)
        return {"LANDING_TARGET", "ODOMETRY"} <= heard.keys() and "odom" in published

    wait_for(exchange, "messages both ways")
    np.testing.assert_allclose(published["odom"].position_xyz, [10, 20, 5])
    target = json.loads(heard["LANDING_TARGET"].fields_json)
    assert (target["frame"], target["position_valid"]) == (1, 1)
    np.testing.assert_allclose([target[name] for name in "xyz"], [21, 12, -1], atol=1e-5)
    odometry = json.loads(heard["ODOMETRY"].fields_json)
    assert odometry["pose_covariance"][:2] == [1, 0]

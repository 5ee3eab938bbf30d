"""The node that makes a simulated robot a MAVLink vehicle."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ros_visualise.core.errors import NoTransform
from ros_visualise.core.params import param
from ros_visualise.data import Imu, NavSatFix, Odometry, Text, Twist
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.links.px4 import Px4Vehicle
from ros_visualise.nodes import node


@dataclass(frozen=True)
class MavlinkVehicleParams:
    """Parameters of `MavlinkVehicle`."""

    address: str = param(
        "udp://:14550",
        "addresses for ground stations, separated by spaces, in the same form as those of the"
        " autopilot node",
        restart=True,
    )
    system: int = param(1, "MAVLink system of the vehicle", min=1, max=255, restart=True)
    gps: bool = param(
        True,
        "use GPS; if off, the vehicle relies on the poses sent to it (as with EKF2_GPS_CTRL = 0)",
        restart=True,
    )
    fixed_frame: str = param(
        "map", "frame whose x axis points east; if it is missing, odom is used"
    )


@node(
    "mavlink_vehicle",
    params=MavlinkVehicleParams,
    inputs={"odom": Odometry, "imu": Imu, "fix": NavSatFix},
    outputs={"cmd_vel": Twist, "mode": Text},
    topics={"cmd_vel": "/cmd_vel", "mode": "/mavlink_vehicle/mode"},
    frames=True,
    splittable=False,
)
class MavlinkVehicle:
    """Presents a flying robot to ground stations and companion computers as a PX4 vehicle.

    It is for simulated robots: a robot that follows the velocities of ``cmd_vel`` does what PX4's
    modes would do, by its own odometry. While it is disarmed, it publishes none.
    """

    def __init__(self, params: MavlinkVehicleParams) -> None:
        self._vehicle = Px4Vehicle(params.address.split(), params.system, params.gps)
        self._mode = ""

    def reset(self) -> None:
        """Start over: the robot is back at its start."""
        self._vehicle.restart()

    def step(
        self,
        params: MavlinkVehicleParams,
        odom: Odometry | None = None,
        imu: Imu | None = None,
        fix: NavSatFix | None = None,
        *,
        frames: FrameTree,
    ) -> dict[str, Twist | Text] | None:
        """Measure; answer odometry by a velocity in level axes that turn with the heading."""
        measured = imu or fix
        if measured is not None:
            self._vehicle.sense(measured)
        if odom is None:
            return None
        command = self._vehicle.measure(odom, _heading(odom, params.fixed_frame, frames))
        found: dict[str, Twist | Text] = {}
        if self._vehicle.state != self._mode:
            self._mode = self._vehicle.state
            found["mode"] = Text(self._mode, odom.header)
        if command is not None:
            found["cmd_vel"] = command
        return found or None

    def finish(self) -> None:
        """Leave all links."""
        self._vehicle.close()


def _heading(odom: Odometry, fixed: str, frames: FrameTree) -> float:
    """Heading of the odometry's x axis, from east to north, radians."""
    try:
        T = frames.lookup(fixed, odom.header.frame_id, odom.header.stamp_ns)
    except NoTransform:
        return 0.0
    return math.atan2(T[1, 0], T[0, 0])

"""Try the precision landing of PX4 or ArduPilot in simulation (SITL), with a target at any place.

The vehicle is armed, takes off, and is sent the position of a target 3 m east and 2 m north of it.
Start a simulation as docs/howto/land-in-sitl.md says. Without one the script prints NOT RUN:

python examples/22_land_in_sitl.py --address udp://:14540 --wait 1
"""

import argparse
import time
from collections.abc import Iterator

import numpy as np

from ros_visualise.data import Header, PoseWithCovarianceStamped
from ros_visualise.links import commands
from ros_visualise.links.vehicle import Vehicle

STILL, NOWHERE, HEIGHT_M, LONGEST_S = np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3), 5.0, 120


def ticks(seconds: float, what: str = "") -> Iterator[int]:
    """Numbers of twentieths of a second, as they pass."""
    for tick in range(round(20 * seconds)):
        yield tick
        time.sleep(0.05)
    assert not what, f"no {what} in {seconds} s"


def land(vehicle: Vehicle) -> float:
    """Take off, land on the target, and return how far off it is, metres."""
    own, target = vehicle.telemetry, vehicle.telemetry.position_xyz + np.array([3.0, 2.0, 0.0])
    for tick in ticks(LONGEST_S, "take-off"):
        if np.asarray(own.position_xyz)[2] > target[2] + 0.9 * HEIGHT_M:
            break
        if tick % 100 == 0 and not vehicle.armed:  # it may not be ready yet
            vehicle.order("take-off", lambda a: commands.take_off(a, own, HEIGHT_M))
    ned = target[[1, 0, 2]] * [1, 1, -1]  # north, east, down
    for tick in ticks(LONGEST_S, "landing"):
        at = Header(time.time_ns(), "odom_ned")
        pose = PoseWithCovarianceStamped(ned, STILL, np.zeros((6, 6)), at)
        vehicle.send_target(pose, at.stamp_ns)
        if tick == 20:
            vehicle.order("landing", lambda a: commands.land(a, on_target=True))
        if tick > 20 and not vehicle.armed:
            break
    return float(np.hypot(*(own.position_xyz - target)[:2]))


parser = argparse.ArgumentParser()
parser.add_argument("--address", default="udp://:14540")
parser.add_argument("--wait", type=float, default=30, help="seconds for the vehicle to be there")
args = parser.parse_args()
vehicle = Vehicle(args.address, 0)
if all(vehicle.telemetry.on_earth(NOWHERE) is None for _ in ticks(args.wait)):
    print(f"NOT RUN: {vehicle.state}, or it has no position")
else:
    commands.permit(True)
    print(f"landed {land(vehicle):.2f} m from the target")
vehicle.close()

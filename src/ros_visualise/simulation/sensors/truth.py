"""What really is, for comparing with what is measured."""

from __future__ import annotations

import numpy as np

from ros_visualise.data import Floats, Header, Odometry
from ros_visualise.data.header import read_only
from ros_visualise.simulation.attitude import Quat, Vector, xyzw
from ros_visualise.simulation.model import BASE

_EXACT = read_only(np.zeros((6, 6)))


def tell_truth(
    stamp_ns: int,
    position: Vector,
    attitude: Quat,
    linear: Floats,
    angular: Floats,
    child: str = BASE,
) -> Odometry:
    """A body's pose in ``map`` and its velocities in its own axes, without any error."""
    header = Header(stamp_ns, "map")
    pose = np.array(position), xyzw(attitude)
    return Odometry(*pose, linear, angular, _EXACT, _EXACT, child, header)

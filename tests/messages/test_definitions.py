"""The types that a recording defines itself."""

import numpy as np
from through import ROS1

from ros_visualise.messages.definitions import Definitions

POINT = "geometry_msgs/msg/Point"


def test_a_type_may_be_defined_anew_after_it_was_read() -> None:
    types = Definitions("ros1")
    xyz = np.array([1.0, 2.0, 3.0]).tobytes()
    assert types.read(POINT, xyz).z == 3.0
    types.define(POINT, "float64 u\nfloat64 v\n")
    types.define("my/msg/Line", "geometry_msgs/Point[2] ends\n")
    assert types.read(POINT, xyz[:16]).v == 2.0
    assert types.read("my/msg/Line", xyz[:16] * 2).ends[1].u == 1.0
    assert types.write(POINT, types.read(POINT, xyz[:16])) == xyz[:16]
    assert ROS1.read(POINT, xyz).y == 2.0

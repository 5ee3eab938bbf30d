"""Forces and torques."""

from __future__ import annotations

from dataclasses import dataclass

from ros_visualise.data import ros_fields as ros
from ros_visualise.data.header import Floats, Header


@dataclass(frozen=True, eq=False)
class WrenchStamped(ros.TabledMessage):
    """A force (3,) in N and a torque (3,) in N m at the origin of the frame of the header."""

    type_name = "geometry_msgs/msg/WrenchStamped"
    ros_fields = ros.table(
        wrench=ros.SubMessage(
            "geometry_msgs/msg/Wrench",
            force=ros.vector("force_xyz"),
            torque=ros.vector("torque_xyz"),
        )
    )

    force_xyz: Floats
    torque_xyz: Floats
    header: Header = Header()

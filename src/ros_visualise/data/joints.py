"""Positions of a robot's joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from ros_visualise.data import ros_fields as ros
from ros_visualise.data.header import Floats, Header
from ros_visualise.data.ros_fields import TabledMessage


def _none() -> Floats:
    return np.zeros(0)


@dataclass(frozen=True)
class JointState(TabledMessage):
    """Positions (N,) in rad or m, velocities, and efforts in N m or N; each may be empty."""

    type_name: ClassVar[str] = "sensor_msgs/msg/JointState"
    ros_fields: ClassVar[ros.RosFields] = {
        "header": ros.HEADER,
        "name": ros.Attribute("names", lambda names: tuple(map(str, names)), list),
        "position": ros.array("positions", -1),
        "velocity": ros.array("velocities", -1),
        "effort": ros.array("efforts", -1),
    }

    names: tuple[str, ...]
    positions: Floats
    velocities: Floats = field(default_factory=_none)
    efforts: Floats = field(default_factory=_none)
    header: Header = Header()

    def __post_init__(self) -> None:
        super().__post_init__()
        for values in (self.positions, self.velocities, self.efforts):
            if len(values) not in (0, len(self.names)):
                raise ValueError(f"{len(values)} values for {len(self.names)} joints")

    @property
    def positions_by_name(self) -> Mapping[str, float]:
        """Joint -> its position, of those that have one."""
        pairs = zip(self.names, self.positions.tolist(), strict=False)
        return {name: position for name, position in pairs if np.isfinite(position)}

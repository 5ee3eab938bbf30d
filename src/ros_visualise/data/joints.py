"""Positions of a robot's joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from ros_visualise.core.message import Message
from ros_visualise.data.fields import header, read_header
from ros_visualise.data.header import Floats, Header


def _none() -> Floats:
    return np.zeros(0)


@dataclass(frozen=True)
class JointState(Message):
    """Positions (N,) in rad or m, velocities, and efforts in N m or N; each may be empty."""

    type_name: ClassVar[str] = "sensor_msgs/msg/JointState"

    names: tuple[str, ...]
    positions: Floats
    velocities: Floats = field(default_factory=_none)
    efforts: Floats = field(default_factory=_none)
    header: Header = Header()

    def __post_init__(self) -> None:
        for values in (self.positions, self.velocities, self.efforts):
            if len(values) not in (0, len(self.names)):
                raise ValueError(f"{len(values)} values for {len(self.names)} joints")

    @property
    def positions_by_name(self) -> Mapping[str, float]:
        """Joint -> its position, of those that have one."""
        pairs = zip(self.names, self.positions.tolist(), strict=False)
        return {name: position for name, position in pairs if np.isfinite(position)}

    def fields(self) -> dict[str, Any]:
        """The fields of a sensor_msgs/msg/JointState."""
        return {
            "header": header(self.header),
            "name": list(self.names),
            "position": self.positions,
            "velocity": self.velocities,
            "effort": self.efforts,
        }

    @classmethod
    def read(cls, message: Any) -> JointState:
        """The joints in a sensor_msgs/msg/JointState."""
        values = (message.position, message.velocity, message.effort)
        positions, velocities, efforts = (np.array(one, np.float64) for one in values)
        names, stamped = tuple(map(str, message.name)), read_header(message.header)
        return cls(names, positions, velocities, efforts, stamped)

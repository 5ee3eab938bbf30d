"""A message of any kind, with a value in each field of its ROS message."""

from __future__ import annotations

from itertools import count
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

from ros_visualise.core.message import Message
from ros_visualise.data import (
    DiagnosticArray,
    DiagnosticStatus,
    Header,
    Image,
    Level,
    OccupancyGrid,
    ParameterEvent,
    PointCloud,
)
from ros_visualise.messages import from_message
from ros_visualise.messages.definitions import Definitions

_TYPES = Definitions("cdr").types
_FIELDS = Definitions("cdr").store.fielddefs


_HEADER = Header(1_700_000_000_987_654_321, "cam")
_LIMITED = [
    Image(np.arange(30, dtype=np.uint16).reshape(2, 5, 3), "bgr16", _HEADER),
    PointCloud(np.zeros((2, 3), [("x", "<f4"), ("rgb", "<u4"), ("n", "u1", (2,))]), False, _HEADER),
    OccupancyGrid(
        np.array([[0, 100, -1], [50, 1, -128]], np.int8),
        resolution=0.25,
        position_xyz=np.arange(3.0),
        quat_xyzw=np.arange(4.0),
        header=_HEADER,
    ),
    DiagnosticArray((DiagnosticStatus("/filters", Level.WARN, "1", {"hz": "9.7"}),), _HEADER),
    ParameterEvent("filters", new={"fps": 30}, changed={"blur": "off"}, header=_HEADER),
]
"""Those whose fields do not take any number."""


def sample(kind: type[Message]) -> Message:
    """Each number is another one, where the kind takes any."""
    for limited in _LIMITED:
        if type(limited) is kind:
            return limited
    return from_message(_message(kind.type_name, count(1)), kind)


def _message(type_name: str, numbers: Any) -> Any:
    return _TYPES[type_name](*(_value(field, numbers) for _, field in _FIELDS[type_name][1]))


def _value(field: Any, numbers: Any) -> Any:
    sort, about = field
    if sort == Nodetype.NAME:
        return _message(about, numbers)
    if sort == Nodetype.BASE:
        number = next(numbers)
        return {"string": f"ä {number}", "bool": True}.get(about[0], number)
    one, size = about
    several = [_value(one, numbers) for _ in range(size or 3)]
    is_array = one[0] == Nodetype.BASE and one[1][0] != "string"
    return np.array(several, one[1][0]) if is_array else several

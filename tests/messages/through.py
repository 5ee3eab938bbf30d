"""Messages through real serialization and back."""

from typing import Any

import numpy as np

from ros_visualise.data import Header
from ros_visualise.messages import from_message, to_message
from ros_visualise.messages.definitions import Definitions

ROS1 = Definitions("ros1")
ROS2 = Definitions("cdr")
HEADER = Header(1_700_000_000_987_654_321, "cam00_optical")


def through_ros1(data: Any, header: Header | None = None) -> Any:
    return _through(ROS1, data, header)


def through_ros2(data: Any, header: Header | None = None) -> Any:
    return _through(ROS2, data, header)


def _through(types: Definitions, data: Any, header: Header | None) -> Any:
    name = data.type_name
    return types.read(name, bytes(types.write(name, to_message(data, types.types, header))))


def assert_same(found: Any, data: Any) -> None:
    """All fields are equal, NaN included, and of the same types."""
    assert type(found) is type(data)
    assert vars(found).keys() == vars(data).keys()
    for name, value in vars(data).items():
        other = getattr(found, name)
        np.testing.assert_array_equal(other, value, err_msg=name)
        assert np.asarray(other).dtype == np.asarray(value).dtype, name


def assert_survives(data: Any) -> None:
    """As ROS 1 and ROS 2 send it."""
    for through in (through_ros1, through_ros2):
        assert_same(from_message(through(data), type(data)), data)

"""Changes of parameters in messages of rcl_interfaces, and back."""

from enum import Enum

import pytest
from through import through_ros2

from ros_visualise.data import Header, ParameterEvent
from ros_visualise.messages import from_message


class Method(Enum):
    CANNY = "canny"


def test_parameter_events_survive() -> None:
    event = ParameterEvent(
        "edge_detector",
        new={"enabled": True, "aperture": 3, "sigma": 1.5, "note": "ä"},
        changed={"low": -1, "off": False, "zero": 0.0},
        header=Header(5_000_000_001),
    )
    found = from_message(through_ros2(event), ParameterEvent)
    assert found == event
    types = [type(value) for values in (found.new, found.changed) for value in values.values()]
    assert types == [bool, int, float, str, int, bool, float]


def test_a_choice_is_written_as_its_value_and_a_node_by_its_full_name() -> None:
    message = through_ros2(ParameterEvent("edges", changed={"method": Method.CANNY}))
    assert message.node == "/edges"
    (changed,) = message.changed_parameters
    assert (changed.name, changed.value.type, changed.value.string_value) == ("method", 4, "canny")


def test_a_parameter_of_another_kind_is_refused() -> None:
    message = through_ros2(ParameterEvent("edges", changed={"low": 1}))
    message.changed_parameters[0].value.type = 7
    with pytest.raises(ValueError, match="parameter low"):
        from_message(message, ParameterEvent)

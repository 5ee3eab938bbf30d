"""Lines of the log and diagnostics in messages of ROS 1 and ROS 2, and back."""

import logging

import pytest
from through import through_ros1, through_ros2

from ros_visualise.data import DiagnosticArray, DiagnosticStatus, Header, Level
from ros_visualise.data.reports import Log, Ros1Log
from ros_visualise.messages import from_message

LEVELS = [logging.DEBUG, logging.INFO, logging.WARNING, logging.ERROR, logging.CRITICAL]


@pytest.mark.parametrize(("kind", "through"), [(Log, through_ros2), (Ros1Log, through_ros1)])
def test_lines_of_all_levels_survive(kind, through):
    for level in LEVELS:
        line = kind("/planner", level, "no path: ä", Header(5_000_000_001))
        assert from_message(through(line), kind) == line


def test_levels_are_those_of_the_messages():
    assert [through_ros1(Ros1Log("n", level, "")).level for level in LEVELS] == [1, 2, 4, 8, 16]
    assert [through_ros2(Log("n", level, "")).level for level in LEVELS] == [10, 20, 30, 40, 50]


def test_diagnostics_survive():
    warning = DiagnosticStatus("camera: rate", Level.WARN, "slow", {"hz": "3.2", "wanted": "10"})
    array = DiagnosticArray((warning, DiagnosticStatus("disk")), Header(5_000_000_001))
    for through in (through_ros1, through_ros2):
        assert from_message(through(array), DiagnosticArray) == array

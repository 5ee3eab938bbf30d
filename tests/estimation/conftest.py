"""The world beside these tests, which a benchmark takes too, and the laws that do not hold yet."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

FAILING: dict[str, list[str]] = {
    "its buffer grows": [
        "test_an_imu_without_odometry_fills_no_memory",
    ],
    "over one wrong height the robot is falsely certain": [
        "test_one_wrong_height_of_the_ground_is_one_error",
    ],
    "named by nothing": [
        "test_clocks_that_differ_are_named",
    ],
    "changes nothing in flight": [
        "test_a_parameter_changed_in_flight_takes_effect[odom_scale]",
        "test_a_parameter_changed_in_flight_takes_effect[odom_turn_scale]",
        "test_a_parameter_changed_in_flight_takes_effect[level_sigma]",
        "test_a_parameter_changed_in_flight_takes_effect[gyro_bias]",
        "test_a_parameter_changed_in_flight_takes_effect[accel_bias]",
        "test_a_parameter_changed_in_flight_takes_effect[ground_sigma]",
    ],
    "fails in the markers": [
        "test_a_parameter_changed_in_flight_takes_effect[mode]",
    ],
    "falsely certain while odometry and IMU disagree": [
        "test_odometry_fails_and_comes_back[slips]",
    ],
}
"""Tests of this folder that fail, by the reason; a line goes when its test passes."""


def pytest_collection_modifyitems(items):
    """Expect those to fail; one that passes is an error."""
    for item in items:
        for reason, names in FAILING.items():
            if item.path.parent == Path(__file__).parent and item.name in names:
                item.add_marker(pytest.mark.xfail(strict=True, reason=reason))

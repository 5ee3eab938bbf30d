"""The world beside these tests, which a benchmark takes too, and the laws that do not hold yet."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

FAILING: dict[str, list[str]] = {
    "false tags are never pruned": [
        "test_false_detections_leave_nothing_behind",
    ],
    "its buffer grows": [
        "test_an_imu_without_odometry_fills_no_memory",
    ],
    "over one wrong height the robot is falsely certain": [
        "test_one_wrong_height_of_the_ground_is_one_error",
    ],
    "named by nothing": [
        "test_sizes_that_are_all_wrong_are_named",
        "test_clocks_that_differ_are_named",
        "test_late_images_are_named",
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
        "test_odometry_fails_and_comes_back[stalls]",
        "test_odometry_fails_and_comes_back[repeats its pose]",
        "test_odometry_fails_and_comes_back[slips]",
    ],
    "a robot with an IMU in a wrong frame is lost at times": [
        "test_an_imu_in_a_wrong_frame_is_named_and_comes_back",
    ],
    "the order of arrival has an effect": [
        "test_any_order_of_arrival_gives_the_same_result[imu]",
        "test_any_order_of_arrival_gives_the_same_result[odometry]",
        "test_any_order_of_arrival_gives_the_same_result[all]",
    ],
    "IMU messages that come too late are not counted": [
        "test_older_ones_are_counted_with_the_reason[imu]",
    ],
    "an IMU message of another time is dropped without a report": [
        "test_one_wild_stamp_is_one_rejected_message[-30.0-imu]",
    ],
}
"""Tests of this folder that fail, by the reason; a line goes when its test passes."""


def pytest_collection_modifyitems(items):
    """Expect those to fail; one that passes is an error."""
    for item in items:
        for reason, names in FAILING.items():
            if item.path.parent == Path(__file__).parent and item.name in names:
                item.add_marker(pytest.mark.xfail(strict=True, reason=reason))

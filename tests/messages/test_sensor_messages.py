"""What sensors measure in messages of sensor_msgs, and back: odd values too."""

from dataclasses import replace

import numpy as np
import pytest
from through import HEADER, assert_survives, through_ros1, through_ros2

from ros_visualise.data import (
    FluidPressure,
    Imu,
    JointState,
    LaserScan,
    MagneticField,
    NavSatFix,
    Range,
    TimeReference,
)
from ros_visualise.messages import from_message

RNG = np.random.default_rng(9)
NOT_MEASURED = np.array([[-1.0, 0, 0], [0, 0, 0], [0, 0, 0]])

IMU = Imu(
    quat_xyzw=RNG.normal(size=4),
    angular_xyz=RNG.normal(size=3),
    linear_xyz=RNG.normal(size=3),
    orientation_covariance=RNG.normal(size=(3, 3)),
    angular_covariance=RNG.normal(size=(3, 3)),
    linear_covariance=RNG.normal(size=(3, 3)),
    header=HEADER,
)
FIX = NavSatFix(49.011212804408, 8.4228850417969, 112.83, RNG.normal(size=(3, 3)), 2, 0, 15, HEADER)
SCAN = LaserScan(
    ranges=np.array([0.5, np.inf, -np.inf, np.nan, 0, 30.000001], np.float32),
    intensities=np.arange(6, dtype=np.float32),
    angle_min=-1.5,
    angle_max=1.5,
    angle_increment=0.5,
    range_min=0.125,
    range_max=30.0,
    time_increment=0.0625,
    scan_time=0.25,
    header=HEADER,
)


@pytest.mark.parametrize(
    "data",
    [
        IMU,
        replace(IMU, quat_xyzw=np.zeros(4), orientation_covariance=NOT_MEASURED),
        replace(IMU, linear_xyz=np.array([np.nan, np.inf, -np.inf])),
        FIX,
        replace(FIX, status=-1, latitude=np.nan, altitude=-np.inf, covariance=NOT_MEASURED),
        MagneticField(RNG.normal(size=3) * 1e-5, NOT_MEASURED, HEADER),
        FluidPressure(101325.25, 0.0, HEADER),
        FluidPressure(np.nan, -1.0, HEADER),
        JointState(("a", "ä"), RNG.normal(size=2), RNG.normal(size=2), np.zeros(0), HEADER),
        JointState((), np.zeros(0), header=HEADER),
        TimeReference(1_700_000_000_123_456_789, "gps", HEADER),
        Range(1.5, 0.125, 12.0, 0.03125, 1, 0.0, HEADER),
        Range(np.inf, 0.125, 12.0, 0.5, 0, 0.0, HEADER),
        SCAN,
        replace(SCAN, intensities=np.zeros(0, np.float32)),
        replace(SCAN, ranges=np.zeros(0, np.float32), intensities=np.zeros(0, np.float32)),
    ],
    ids=lambda data: type(data).__name__,
)
def test_measurements_survive(data):
    assert_survives(data)


def test_the_fields_stand_where_ros_has_them():
    imu = through_ros1(IMU)
    assert imu.orientation.w == IMU.quat_xyzw[3]
    assert imu.angular_velocity.y == IMU.angular_xyz[1]
    assert imu.linear_acceleration.z == IMU.linear_xyz[2]
    assert imu.angular_velocity_covariance[5] == IMU.angular_covariance[1, 2]
    fix = through_ros2(FIX)
    assert (fix.status.status, fix.status.service, fix.position_covariance_type) == (0, 15, 2)
    assert fix.position_covariance[3] == FIX.covariance[1, 0]
    assert through_ros2(FluidPressure(5.0, 2.0)).fluid_pressure == 5.0


def test_the_variance_of_a_range_is_read_where_ros_has_it():
    given = Range(1.5, 0.125, 12.0, 0.03125, 1, 0.0625, HEADER)
    assert not hasattr(through_ros1(given), "variance")
    assert from_message(through_ros1(given), Range) == replace(given, variance=0.0)
    assert from_message(through_ros2(given), Range) == given


def test_every_second_ray_is_written_as_it_looks():
    found = from_message(through_ros2(replace(SCAN, ranges=SCAN.ranges[::2])), LaserScan)
    np.testing.assert_array_equal(found.ranges, SCAN.ranges[::2])


def test_a_covariance_of_another_size_is_refused():
    message = through_ros1(IMU)
    message.orientation_covariance = np.zeros(8)
    with pytest.raises(ValueError, match="8"):
        from_message(message, Imu)

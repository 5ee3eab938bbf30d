"""Sensors' errors are those that were declared: laws of their statistics, with fixed seeds."""

import math
from dataclasses import replace

import numpy as np
import pytest
from simulated_runs import BLIND_HUSKY, collect

from ros_visualise.geometry.geodesy import LocalPlane
from ros_visualise.simulation.robots.husky.settings import HuskyParams
from ros_visualise.simulation.robots.quadrotor.settings import QuadrotorParams
from ros_visualise.simulation.sensors.barometer import Barometer, pressure_at
from ros_visualise.simulation.sensors.gps import GpsSensor
from ros_visualise.simulation.sensors.imu import ImuSensor
from ros_visualise.simulation.sensors.magnetometer import Magnetometer
from ros_visualise.simulation.sensors.odometry import VisualInertialOdometry, WheelOdometry
from ros_visualise.simulation.simulator import Simulation

LEVEL = (1.0, 0.0, 0.0, 0.0)
AT_REST = np.array([0, 0, 0, 0, 0, 9.81])
HUSKY, QUADROTOR = HuskyParams(), QuadrotorParams()
METRES_PER_DEGREE = 111_206.0  # of a meridian at 49 degrees north


def test_an_imu_at_rest_feels_g_upwards():
    found = collect(Simulation("husky", "plane", settings=BLIND_HUSKY, seed=3), 4.0)["imu"]
    force = np.mean([m.linear_xyz for m in found[100:]], axis=0)
    assert force == pytest.approx([0, 0, 9.81], abs=4 * HUSKY.accel_bias)
    exact = replace(BLIND_HUSKY, accel_bias=0.0, accel_walk=0.0, accel_density=0.0)
    found = collect(Simulation("husky", "plane", settings=exact), 4.0)["imu"]
    assert found[-1].linear_xyz == pytest.approx([0, 0, 9.81], abs=1e-2)
    assert found[0].header.frame_id == "imu_link"


def stamps(count: int, rate_hz: float = HUSKY.imu_rate) -> list[int]:
    return [round(i * 1e9 / rate_hz) for i in range(count)]


def test_imu_noise_has_its_density_and_its_covariance():
    sensor = ImuSensor(replace(HUSKY, gyro_walk=0.0, accel_walk=0.0), seed=1)
    messages = [sensor.measure(stamp_ns, LEVEL, AT_REST) for stamp_ns in stamps(4000)]
    for name, density, covariance in (
        ("angular_xyz", HUSKY.gyro_density, messages[0].angular_covariance),
        ("linear_xyz", HUSKY.accel_density, messages[0].linear_covariance),
    ):
        noise = np.std([getattr(m, name) for m in messages], axis=0)
        assert noise == pytest.approx(np.full(3, density * math.sqrt(HUSKY.imu_rate)), rel=0.05)
        assert np.diag(covariance) == pytest.approx(noise**2, rel=0.1)


def test_imu_biases_differ_from_run_to_run_and_walk():
    still = replace(HUSKY, gyro_density=0.0, accel_density=0.0)
    first, later = [], []
    for seed in range(200):
        sensor = ImuSensor(still, seed)
        messages = [sensor.measure(stamp_ns, LEVEL, np.zeros(6)) for stamp_ns in stamps(101)]
        first.append(np.concatenate([messages[0].angular_xyz, messages[0].linear_xyz]))
        later.append(np.concatenate([messages[-1].angular_xyz, messages[-1].linear_xyz]))
    declared = np.repeat([HUSKY.gyro_bias, HUSKY.accel_bias], 3)
    assert np.std(first, axis=0) == pytest.approx(declared, rel=0.2)
    walked = np.std(np.subtract(later, first), axis=0)  # of one second
    assert walked == pytest.approx(np.repeat([HUSKY.gyro_walk, HUSKY.accel_walk], 3), rel=0.2)


def test_the_attitude_of_the_imu_errs_as_declared():
    ends = [ImuSensor(HUSKY, seed).measure(0, LEVEL, AT_REST).quat_xyzw for seed in range(800)]
    angles = 2 * np.array(ends)[:, :3]
    assert np.std(angles, axis=0) == pytest.approx(np.full(3, HUSKY.imu_attitude), rel=0.1)


def fixes(params: HuskyParams, place: np.ndarray, seeds: range) -> np.ndarray:
    """Metres east, north and up of the origin."""
    found = [GpsSensor(params, seed).measure(0, place) for seed in seeds]
    east = METRES_PER_DEGREE * math.cos(math.radians(49)) * 1.00281  # the ellipsoid is wider there
    return np.array(
        [
            ((f.longitude - 8.4) * east, (f.latitude - 49) * METRES_PER_DEGREE, f.altitude - 116)
            for f in found
        ]
    )


def test_gps_is_where_the_antenna_is_and_errs_as_it_says():
    exact = replace(HUSKY, gps_noise=0.0, gps_drift=0.0)
    assert fixes(exact, np.array([100.0, 200, 5]), range(1))[0] == pytest.approx(
        [100, 200, 5], rel=1e-3
    )
    errors = fixes(HUSKY, np.zeros(3), range(1000))
    declared = math.hypot(HUSKY.gps_noise, HUSKY.gps_drift) * np.array([1, 1, HUSKY.gps_vertical])
    assert errors.std(axis=0) == pytest.approx(declared, rel=0.08)
    assert errors.mean(axis=0) == pytest.approx([0, 0, 0], abs=0.2)
    covariance = GpsSensor(HUSKY, 0).measure(0, np.zeros(3)).covariance
    assert np.diag(covariance) == pytest.approx(declared**2)


def test_the_gps_drift_forgets_itself_in_its_time():
    params = replace(HUSKY, gps_noise=0.0, gps_rate=0.1, gps_drift_time=60.0)
    sensor = GpsSensor(params, 5)
    up = np.array([sensor.measure(t, np.zeros(3)).altitude - 116 for t in stamps(20000, 0.1)])
    after = 6  # samples, a minute
    correlation = np.corrcoef(up[:-after], up[after:])[0, 1]
    assert correlation == pytest.approx(math.exp(-1), abs=0.06)


def test_the_magnetometer_sees_the_declared_field_with_the_declared_errors():
    micro = np.array(
        [
            Magnetometer(QUADROTOR, seed).measure(0, np.eye(3)).field_xyz * 1e6
            for seed in range(1500)
        ]
    )
    dip, east = map(math.radians, (QUADROTOR.mag_inclination, QUADROTOR.mag_declination))
    level = QUADROTOR.mag_strength * math.cos(dip)
    field = [level * math.sin(east), level * math.cos(east), -48.6 * math.sin(dip)]
    assert micro.mean(axis=0) == pytest.approx(field, abs=0.12)
    declared = math.hypot(QUADROTOR.mag_bias, QUADROTOR.mag_noise)
    assert micro.std(axis=0) == pytest.approx(np.full(3, declared), rel=0.08)
    one = Magnetometer(QUADROTOR, 2)
    noise = np.std([one.measure(0, np.eye(3)).field_xyz for _ in range(2000)], axis=0)
    assert noise * 1e6 == pytest.approx(np.full(3, QUADROTOR.mag_noise), rel=0.06)


def test_a_magnetometer_that_heads_north_has_the_field_ahead():
    exact = replace(QUADROTOR, mag_bias=0.0, mag_noise=0.0, mag_declination=0.0)
    north = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])  # R_map_body
    x, y, z = Magnetometer(exact, 0).measure(0, north).field_xyz
    assert x > 0
    assert y == pytest.approx(0, abs=1e-12)
    assert z < 0


def test_the_barometer_loses_twelve_pascal_a_metre_and_errs_as_declared():
    assert pressure_at(0.0) - pressure_at(1.0) == pytest.approx(12.01, abs=0.02)
    assert pressure_at(5000.0) == pytest.approx(54020, rel=1e-3)  # table of ISO 2533
    errors = [
        Barometer(QUADROTOR, 116, s).measure(0, 0.0).pressure - pressure_at(116)
        for s in range(1500)
    ]
    assert np.std(errors) == pytest.approx(math.hypot(1.5, 8.0), rel=0.06)
    assert Barometer(QUADROTOR, 116, 0).measure(0, 0.0).variance == pytest.approx(1.5**2 + 8.0**2)


def test_a_drift_forgets_itself_by_the_stamps_however_they_come():
    params = replace(QUADROTOR, baro_noise=0.0, baro_drift_time=10.0)
    times = np.cumsum(np.tile([0.015, 0.02, 0.015], 40_000))
    barometer = Barometer(params, 116, 3)
    drift = np.array([barometer.measure(round(t * 1e9), 0.0).pressure for t in times])
    after = 600  # samples, 10 s
    assert np.corrcoef(drift[:-after], drift[after:])[0, 1] == pytest.approx(math.exp(-1), abs=0.15)


@pytest.mark.parametrize("latitude", [0.0, 49.0, -60.0, 89.0])
def test_a_fix_is_where_the_antenna_is_to_a_millimetre(latitude):
    exact = replace(HUSKY, gps_noise=0.0, gps_drift=0.0, gps_latitude=latitude)
    place = np.array([800.0, -900.0, 30.0])
    fix = GpsSensor(exact, 0).measure(0, place)
    plane = LocalPlane(latitude, exact.gps_longitude, exact.gps_altitude)
    found = plane.to_enu([fix.latitude, fix.longitude, fix.altitude])
    assert found == pytest.approx(place, abs=1e-3)


def test_wheel_odometry_drifts_with_its_scale_and_with_the_root_of_the_way():
    ends = []
    for seed in range(600):
        odometry = WheelOdometry(HUSKY, seed)
        for _ in range(25):
            last = odometry.advance(0, 0.8, 0.0)
        ends.append(last.position_xyz[0])
    assert np.mean(ends) == pytest.approx(20, abs=0.05)
    declared = math.hypot(HUSKY.odom_scale * 20, HUSKY.odom_noise * math.sqrt(20))
    assert np.std(ends) == pytest.approx(declared, rel=0.1)
    assert last.pose_covariance[0, 0] == pytest.approx(declared**2, rel=0.01)


def test_wheel_odometry_drifts_in_turning():
    yaws = []
    for seed in range(600):
        odometry = WheelOdometry(HUSKY, seed)
        for _ in range(50):
            last = odometry.advance(0, 0.0, 0.04)
        yaws.append(2 * math.atan2(last.quat_xyzw[2], last.quat_xyzw[3]))
    declared = math.hypot(HUSKY.odom_turn_scale * 2, HUSKY.odom_turn_noise * math.sqrt(2))
    assert np.mean(yaws) == pytest.approx(2, abs=0.01)
    assert np.std(yaws) == pytest.approx(declared, rel=0.1)


def test_visual_inertial_odometry_drifts_along_the_way_and_not_at_rest():
    ends, zero = [], np.zeros(3)
    for seed in range(400):
        odometry = VisualInertialOdometry(QUADROTOR, seed, (5.0, 1.0, 0.0), LEVEL)
        for i in range(1, 51):
            last = odometry.advance(0, (5.0 + 0.5 * i, 1.0, 0.0), LEVEL, zero, zero)
        ends.append(last.position_xyz)
        again = odometry.advance(0, (30.0, 1.0, 0.0), LEVEL, zero, zero)
        assert again.position_xyz == pytest.approx(last.position_xyz)
    spread, way = np.std(ends, axis=0), 25.0
    walk = QUADROTOR.odom_noise * math.sqrt(way)
    assert np.mean(ends, axis=0) == pytest.approx([way, 0, 0], abs=0.05)
    assert spread[0] == pytest.approx(math.hypot(QUADROTOR.odom_scale * way, walk), rel=0.12)
    aside = QUADROTOR.odom_yaw_noise * math.sqrt(way) * way / math.sqrt(3)
    assert spread[1] == pytest.approx(math.hypot(walk, aside), rel=0.12)
    assert spread[2] == pytest.approx(walk, rel=0.12)

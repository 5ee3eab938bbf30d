"""All sensors of the registry: their derivatives, and what they say of a robot."""

import numpy as np
import pytest

from ros_visualise.core.errors import OpenError
from ros_visualise.data import FluidPressure, Header, MagneticField, Range
from ros_visualise.data import TwistWithCovarianceStamped as Twist
from ros_visualise.estimation.imu import Mounting
from ros_visualise.estimation.navigator import Navigator
from ros_visualise.estimation.params import NavigatorParams
from ros_visualise.estimation.robot import RobotState, core
from ros_visualise.estimation.sensors import SENSORS, Prior, Reading
from ros_visualise.geometry import rigid
from ros_visualise.geometry.rotations import from_rpy, to_matrix

AT = Mounting(to_matrix(from_rpy([0.1, -0.2, 0.4])), np.array([0.3, -0.1, 0.2]))
DOWN = Mounting(to_matrix(from_rpy([0.0, np.pi / 2 - 0.2, 0.3])), AT.p)
NAMES = [sensor.name for sensor in SENSORS.all()]
SIZES = {"gps": 3, "barometer": 1, "rangefinder": 1}


def robot(seed):
    random = np.random.default_rng(seed)
    return RobotState(
        R=to_matrix(from_rpy(random.normal(0, [0.2, 0.2, 2]))),
        p=random.normal([0, 0, 10], 5),
        v=random.normal(0, 3, 3),
        rates=random.normal(0, 0.5, 3),
        datum_R=to_matrix(from_rpy([0, 0, random.normal()])),
        datum_p=random.normal(0, 20, 3),
        own=random.normal(0, 0.05, len(RobotState().own)),
    )


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_those_of_the_expected_values(name, seed):
    sensor, params, one = SENSORS.find(name), NavigatorParams(), robot(seed)
    size = SIZES.get(name, 3)
    noise = np.eye(1 if name == "magnetometer" else size) * 0.04
    values = np.random.default_rng(seed).normal(size=size) + 3
    mounting = DOWN if name == "rangefinder" else AT
    reading = Reading(name, 0, values, noise, mounting)
    found = sensor.expect(one, reading, params)
    step = 1e-6
    left = (3, 4) if name == "magnetometer" else ()  # it leaves the tilt as it is
    for row in sorted({*range(core())} - {*left}):
        error = np.zeros(core())
        error[row] = step
        ahead = sensor.expect(one.moved(error), reading, params).residual
        behind = sensor.expect(one.moved(-error), reading, params).residual
        slope = (behind - ahead) / (2 * step)
        np.testing.assert_allclose(found.H[:, row], slope, atol=2e-6, err_msg=f"error {row}")


def test_a_barometer_measures_height_by_the_standard_atmosphere():
    sensor, params = SENSORS.find("barometer"), NavigatorParams()
    (height,), ((variance,),) = sensor.read(FluidPressure(89874.6, 100.0), params)
    assert height == pytest.approx(1000.0, abs=0.5)  # ISO 2533's table
    assert np.sqrt(variance) == pytest.approx(10 / 10.9, rel=0.03)  # 10.9 Pa are a metre there
    assert sensor.read(FluidPressure(0.0), params) == "is not an air pressure"


def test_a_rangefinder_that_looks_down_measures_the_height():
    sensor, params = SENSORS.find("rangefinder"), NavigatorParams(ground_height=1.0)
    down = Mounting(to_matrix(from_rpy([0, np.pi / 2, 0])), np.zeros(3))
    reading = Reading("rangefinder", 0, np.array([9.0]), np.eye(1), down)
    level = RobotState(p=np.array([0, 0, 10.0]))
    assert sensor.expect(level, reading, params).residual == pytest.approx([0.0], abs=1e-12)
    flat = RobotState(R=to_matrix(from_rpy([0, 1.2, 0])), p=level.p)
    assert sensor.expect(flat, reading, params) is None
    assert sensor.read(Range(12.0, 0.1, 10.0), params) == "out of its range"


def test_a_disturbed_magnetometer_turns_no_robot_upside_down():
    sensor, params, one = SENSORS.find("magnetometer"), NavigatorParams(), robot(0)
    reading = Reading("magnetometer", 0, np.array([0.3, 0.2, -0.9]), np.eye(1), AT)
    assert not sensor.expect(one, reading, params).H[0, 3:5].any()


def test_a_magnetometer_tells_the_heading_from_north():
    sensor, params = SENSORS.find("magnetometer"), NavigatorParams(magnetometer_declination=3.0)
    yaw = 0.7
    north = np.pi / 2 - np.radians(3)
    field = np.array([20.0 * np.cos(north), 20 * np.sin(north), -40]) * 1e-6  # east, north, up
    R = to_matrix(from_rpy([0, 0, yaw]))
    values = sensor.read(MagneticField(R.T @ field, header=Header(0, "imu")), params)
    reading = Reading("magnetometer", 0, *values, Mounting(np.eye(3), np.zeros(3)))
    assert sensor.expect(RobotState(R=R), reading, params).residual == pytest.approx([0], abs=1e-9)
    off = RobotState(R=to_matrix(from_rpy([0, 0, yaw + 0.1])))
    assert sensor.expect(off, reading, params).residual == pytest.approx([0.1], abs=1e-9)


def test_only_the_measured_parts_of_a_velocity_count():
    sensor, params = SENSORS.find("wheel_speed"), NavigatorParams()
    covariance = np.diag([1e-4, 1e6, 1e6, 1e6, 1e6, 1e6])
    values = sensor.read(Twist(np.array([2.0, 0, 0]), np.zeros(3), covariance), params)
    reading = Reading("wheel_speed", 0, *values, Mounting(np.eye(3), np.zeros(3)))
    R = to_matrix(from_rpy([0, 0, 1.0]))
    found = sensor.expect(RobotState(R=R, v=R @ [1.5, 0.3, 0]), reading, params)
    assert found.residual == pytest.approx([0.5])


def test_deviations_of_a_calibration_let_the_focal_length_be_estimated(tmp_path):
    written = tmp_path / "camera.yaml"
    covariance = np.diag([4.0, 4, 1, 1, 0, 0, 0, 0, 0])  # two pixels of 500
    written.write_text(
        "image_width: 640\nimage_height: 480\ncamera_name: c\n"
        "camera_matrix: {rows: 3, cols: 3, data: [500, 0, 320, 0, 500, 240, 0, 0, 1]}\n"
        "distortion_model: plumb_bob\n"
        "distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n"
        "rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}\n"
        "projection_matrix: {rows: 3, cols: 4,"
        " data: [500, 0, 320, 0, 0, 500, 240, 0, 0, 0, 1, 0]}\n"
        f"intrinsics_covariance: {{rows: 9, cols: 9, data: {covariance.ravel().tolist()}}}\n"
    )
    settings = NavigatorParams(calibration=str(written)).settings()
    assert settings.camera.focal == pytest.approx(2 / 500)
    with pytest.raises(OpenError, match="absent"):
        NavigatorParams(calibration=str(tmp_path / "absent.yaml")).settings()


def test_a_sensor_that_fails_holds_up_no_others(monkeypatch):
    navigator = Navigator(NavigatorParams().settings())
    stamps = range(10**18, 10**18 + 10**9, 10**8)
    for stamp_ns in stamps[:5]:
        navigator.odometry(stamp_ns, rigid.IDENTITY)
    monkeypatch.setattr(SENSORS.find("barometer"), "expect", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        navigator.read(Reading("barometer", stamps[4], np.zeros(1), np.eye(1), AT))
    for stamp_ns in stamps[5:]:
        assert navigator.odometry(stamp_ns, rigid.IDENTITY).is_located


def test_states_return_to_their_prior_with_time():
    keep, added = Prior(2.0, time_s=10.0).over(5.0)
    assert keep**2 * 4.0 + added == pytest.approx(4.0)
    assert Prior(1.0, walk=0.1).over(9.0) == (1.0, pytest.approx(0.09))

"""What the navigator makes of an IMU, of GPS, and of things on the ground."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from flights import DRIFT, GPS_ORIGIN, T_BASE_CAMERA, Flight, field_of_tags, lawn_mower

from ros_visualise.estimation.camera_view import view_of
from ros_visualise.estimation.imu import ImuBuffer, ImuNoise, Mounting
from ros_visualise.estimation.landmark import KnownLandmark
from ros_visualise.estimation.landmark_map import MapMode, MapRules
from ros_visualise.estimation.navigator import Navigator
from ros_visualise.estimation.odometry import OdometryNoise
from ros_visualise.estimation.points import GroundPlane
from ros_visualise.estimation.sensors import SENSORS, Reading
from ros_visualise.estimation.sensors.gps import GpsErrorParams
from ros_visualise.estimation.settings import NavigatorSettings
from ros_visualise.geometry import rigid
from ros_visualise.geometry.se3 import turn_between

LEVEL = np.radians(0.5)
ODOMETRY = OdometryNoise(0.01, 0.0, 0.0, 0.02, 0.003, 0.0, 0.0, 0.0)
IMU = ImuNoise(
    DRIFT.gyro_density,
    DRIFT.accel_density,
    DRIFT.gyro_bias,
    DRIFT.accel_bias,
    DRIFT.gyro_walk,
    DRIFT.accel_walk,
)
GPS = GpsErrorParams(gps_slow=0.966, gps_origin=", ".join(map(str, GPS_ORIGIN)))
BUILD = NavigatorSettings(
    MapRules(MapMode.BUILD), ODOMETRY, IMU, level_rad=LEVEL, sensors={"gps": GPS}
)
IN_THE_MIDDLE = Mounting(np.eye(3), np.zeros(3))


@cache
def flight(length_m=60.0, tags=6, posts=0):
    """A short one, all that is told on it, and what its IMU and its receiver measure."""
    random = np.random.default_rng(3)
    there = field_of_tags(random, 64, 24, tags) if tags else {}
    feet = np.column_stack([random.uniform(-4, 30, posts), random.uniform(-6, 24, posts)])
    feet = np.column_stack([feet, np.zeros(posts)])
    points = lawn_mower(length_m, row_m=24.0)
    one = Flight(there, points, 5, odom_hz=10, images_hz=2.5, level_rad=LEVEL, posts=feet)
    return one, tuple(one.told()), one.imu(), one.gps()


def known(tags):
    exact = np.eye(6) * 1e-8
    return {
        f"tag36h11_{id}": KnownLandmark.of(tag.T[:3, :3], tag.T[:3, 3], exact, tag.side_m)
        for id, tag in tags.items()
    }


def fly(navigator, one, told, imu=(), gps=(), mounting=IN_THE_MIDDLE):
    """Where it is wrong (N, 3), its covariances, and what it was told last."""
    errors, covariances, now = [], [], None
    imu, gps = list(imu), list(gps)
    for number, stamp, pose, seen in told:
        while imu and imu[0].header.stamp_ns <= stamp:
            one_imu = imu.pop(0)
            rates, force = one_imu.angular_xyz, one_imu.linear_xyz
            navigator.imu(one_imu.header.stamp_ns, rates, force, mounting)
        while gps and gps[0].header.stamp_ns <= stamp:
            fix = gps.pop(0)
            values = SENSORS.find("gps").read(fix, GPS)
            navigator.read(Reading("gps", fix.header.stamp_ns, *values, IN_THE_MIDDLE))
        now = navigator.odometry(stamp, pose)
        if seen is not None:
            navigator.see(view_of(seen, T_BASE_CAMERA))
        if now is not None and now.is_located:
            errors.append(one.places[number] - now.T_map_base[:3, 3])
            covariances.append(now.covariance[:3, :3])
    return np.array(errors), np.array(covariances)


def rms(errors):
    return float(np.sqrt((errors**2).sum(axis=-1).mean()))


def assert_expected(error, covariance):
    """That it is one of the 999 of 1000 that its covariance expects."""
    assert error @ np.linalg.solve(covariance, error) < 16.27


def blind(told, after=0):
    return [(n, s, pose, seen if n < after else None) for n, s, pose, seen in told]


def test_an_imu_tells_how_level_the_robot_is():
    one, told, imu, _ = flight()

    def tilt(imu):
        """Standard deviations, and by how much it is wrong: about x and y, radians."""
        navigator = Navigator(BUILD)
        for _, stamp, pose, _ in told:
            while imu and imu[0].header.stamp_ns <= stamp:
                measured = imu.pop(0)
                rates, force = measured.angular_xyz, measured.linear_xyz
                navigator.imu(measured.header.stamp_ns, rates, force, IN_THE_MIDDLE)
            now = navigator.odometry(stamp, pose)
        off = turn_between(one.true_pose(len(told) - 1)[:3, :3], now.T_map_base[:3, :3])[:2]
        return np.sqrt(np.diag(now.covariance)[3:5]), off

    sigma, off = tilt(list(imu))
    assert (sigma < 0.2 * tilt([])[0]).all()
    assert (np.abs(off) < 3.3 * sigma).all()


def test_a_map_that_is_built_with_an_imu_lies_level():
    one, told, imu, _ = flight(tags=20)

    def marks(imu):
        navigator = Navigator(BUILD)
        fly(navigator, one, told, imu)
        used = navigator.map.used
        found = navigator.state.landmarks_p[navigator.state.indices([m.key for m in used])]
        true = [one.tags[int(mark.name.rpartition("_")[2])].T[:3, 3] for mark in used]
        return rms(found - np.array(true))

    assert marks(imu) < min(0.1, 0.7 * marks(()))


def test_an_imu_carries_the_robot_through_three_seconds_without_odometry():
    """Which then begins elsewhere, so that it tells nothing of the time between."""
    one, told, imu, _ = flight(tags=20)
    elsewhere = (7.0, -3.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    last = len(told) - 40
    after = [(n, s, rigid.compose(elsewhere, pose), None) for n, s, pose, _ in told[last + 30 :]]
    navigator = Navigator(replace(BUILD, rules=MapRules(MapMode.FROZEN)), known(one.tags))
    errors, covariances = fly(navigator, one, (*told[:last], *after), imu)
    assert np.linalg.norm(errors[-1]) < 0.3
    assert navigator.counts["losses"] == 0
    assert_expected(errors[-1], covariances[-1])


def test_an_imu_that_is_mounted_otherwise_than_said_is_left_out():
    one, told, imu, _ = flight()
    askew = Mounting(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
    without, _ = fly(Navigator(BUILD), one, told)
    navigator = Navigator(BUILD)
    errors, _ = fly(navigator, one, told, imu, mounting=askew)
    assert navigator.counts["imu rejected"]
    assert any("the IMU contradicts the odometry" in text for text in navigator.news())
    assert rms(errors) < 2 * rms(without) + 0.5


def test_an_imu_that_counts_in_g_is_left_out():
    one, told, imu, _ = flight()
    in_g = [replace(measured, linear_xyz=measured.linear_xyz / 9.80665) for measured in imu]
    without, _ = fly(Navigator(BUILD), one, told)
    navigator = Navigator(BUILD)
    errors, _ = fly(navigator, one, told, in_g)
    assert navigator.counts["imu rejected"]
    assert rms(errors) < 2 * rms(without) + 0.5


def test_an_imu_may_come_in_any_order_and_what_is_no_number_is_refused():
    imu = ImuBuffer()
    for stamp in (10, 30, 20, 40, 50):
        assert imu.add(stamp * 10**6, np.zeros(3), np.array([0, 0, 9.8]), IN_THE_MIDDLE)
    assert not imu.add(60 * 10**6, np.full(3, np.nan), np.zeros(3), IN_THE_MIDDLE)
    assert not imu.add(20 * 10**6, np.zeros(3), np.zeros(3), IN_THE_MIDDLE)
    parts = imu.between(10 * 10**6, 50 * 10**6)
    assert [one.seconds for one in parts] == pytest.approx([0.01] * 4)


def test_an_imu_away_from_the_middle_feels_its_turns():
    """Said to be elsewhere, and measured there: as if it were in the middle."""
    at = Mounting(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([0.4, -0.2, 0.1]))
    imu = ImuBuffer()
    turn, speed_up = np.array([0.2, -0.5, 1.5]), np.array([0.5, 0.1, -0.3])
    for number in range(20):
        rates = turn + speed_up * number / 100
        force = np.array([1.0, 2, 9]) + np.cross(rates, np.cross(rates, at.p))
        force = force + np.cross(speed_up, at.p)
        imu.add(10_000_000 * number, at.R.T @ rates, at.R.T @ force, at)
    parts = imu.between(50_000_000, 150_000_000)
    assert sum(one.seconds for one in parts) == pytest.approx(0.1)
    np.testing.assert_allclose([one.force for one in parts], [[1, 2, 9]] * len(parts))


def test_gps_holds_the_error_small_between_landmarks():
    one, told, _, gps = flight(length_m=200.0, tags=0)
    without, _ = fly(Navigator(BUILD), one, told)
    navigator = Navigator(BUILD, start=rigid.IDENTITY)
    errors, covariances = fly(navigator, one, told, gps=gps)
    assert navigator.counts["gps used"] > 50
    end = len(errors) // 2
    assert rms(errors[end:]) < 0.8 * rms(without[end:])
    assert_expected(errors[-1], covariances[-1])


def test_gps_may_come_seconds_before_the_odometry():
    """As an odometry by eye does, which first looks for a start."""
    one, told, _, gps = flight(length_m=200.0, tags=0)
    late = [sight for sight in told if sight[1] > gps[5].header.stamp_ns]
    navigator = Navigator(BUILD, start=rigid.IDENTITY)
    errors, _ = fly(navigator, one, late, gps=gps)
    assert len(errors) > 0.9 * len(late)
    assert navigator.counts["gps used"] > 50


def test_gps_finds_out_where_it_counts_from():
    one, told, _, gps = flight(length_m=200.0, tags=0)
    nobody = replace(BUILD, sensors={"gps": replace(GPS, gps_origin="")})
    navigator = Navigator(nobody)
    errors, covariances = fly(navigator, one, told, gps=gps)
    assert navigator.counts["gps used"] > 50
    assert abs(navigator.state.robot.datum_R[1, 0]) < 0.1  # the map's x axis points east
    assert_expected(errors[-1], covariances[-1])


def test_gps_that_jumps_is_refused_and_then_doubted_as_the_robot_is():
    one, told, _, gps = flight(length_m=200.0, tags=0)
    half = len(gps) // 2
    jumped = [*gps[:half], *(replace(fix, latitude=fix.latitude + 1e-3) for fix in gps[half:])]
    navigator = Navigator(BUILD, start=rigid.IDENTITY)
    soon = gps[half].header.stamp_ns + 2 * 10**9
    errors, _ = fly(navigator, one, [now for now in told if now[1] < soon], gps=jumped)
    assert np.linalg.norm(errors[-1]) < 5
    errors, covariances = fly(navigator, one, [now for now in told if now[1] >= soon], gps=jumped)
    assert any("gps has contradicted the estimate" in text for text in navigator.news())
    later = covariances[60:]  # by then it has raised the uncertainty
    for error, covariance in zip(errors[60:], later, strict=True):
        assert_expected(error, covariance)


def test_posts_on_the_ground_are_mapped_and_correct_the_robot():
    one, told, _, _ = flight(length_m=120.0, tags=0, posts=25)
    settings = replace(BUILD, rules=MapRules(MapMode.BUILD, plane=GroundPlane(0.0, 0.05, 0.02)))
    without, _ = fly(Navigator(settings), one, blind(told))
    navigator = Navigator(settings)
    errors, covariances = fly(navigator, one, told)
    assert rms(errors) < 0.5 * rms(without)
    assert_expected(errors[-1], covariances[-1])
    used = navigator.map.used
    found = navigator.state.landmarks_p[navigator.state.indices([post.key for post in used])]
    off = np.linalg.norm(found[:, None] - one.posts, axis=-1)
    assert len(used) > 10
    assert (off.argmin(axis=1)[:, None] == off.argmin(axis=1)).sum() == len(used)  # each once
    assert off.min(axis=1).max() < 1.0


def test_posts_of_a_map_correct_a_robot_that_a_tag_has_located():
    one, told, _, _ = flight(length_m=120.0, tags=1, posts=25)
    posts = {
        f"post_{n}": KnownLandmark.point(foot, np.eye(3) * 1e-4, "post", 7)
        for n, foot in enumerate(one.posts)
    }
    begun = BUILD
    navigator = Navigator(begun, posts)
    errors, covariances = fly(navigator, one, told)
    assert any(name.startswith("post_") for name in navigator.map.landmarks)
    assert rms(errors) < 0.3
    assert_expected(errors[-1], covariances[-1])

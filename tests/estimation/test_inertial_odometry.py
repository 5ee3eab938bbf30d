"""Laws of visual-inertial odometry, and its errors on a flight whose formulas are its own."""

from types import SimpleNamespace

import numpy as np
import pytest
from inertial_flight import FOCAL, MOUNTING, T_BASE_CAMERA, InertialFlight

from ros_visualise.estimation.imu import GYRO, ImuBuffer, ImuNoise
from ros_visualise.estimation.inertial import odometry
from ros_visualise.estimation.inertial.filter import InertialFilter, InertialSettings
from ros_visualise.estimation.inertial.jumps import jump_of, largest_jump
from ros_visualise.estimation.inertial.lens import (
    FOCAL_SIGMA,
    LensErrors,
    corrected,
    points_of,
    values_of,
)
from ros_visualise.estimation.inertial.readout import UNKNOWN
from ros_visualise.estimation.inertial.sliding import (
    CORE,
    MOTION,
    READOUTS,
    SHAPE,
    VIEW,
    SlidingState,
)
from ros_visualise.estimation.inertial.starting import level, start_at_rest
from ros_visualise.estimation.inertial.tracks import (
    CornerNoise,
    begin_points,
    correct_by_points,
    limit,
    project,
    together,
    triangulate,
)
from ros_visualise.estimation.measuring import CAMERAS
from ros_visualise.estimation.robot import RobotState
from ros_visualise.estimation.settings import CameraErrors
from ros_visualise.estimation.visual.focal import pinhole
from ros_visualise.geometry import se3
from ros_visualise.vision.tracking import FollowedCorners

STEP_NS = 100_000_000
NOISE = CornerNoise(1e-3, 5e-4)
INFO = pinhole((480, 640), FOCAL / 640)


def state_with_views(seed=0, views=5, points=4):
    """A state of random views, which see corners (F, C, 2) with errors."""
    noise = np.random.default_rng(seed)
    R, p = se3.exp(noise.normal(size=6) * 0.3)
    robot = RobotState(R=R, p=p + 3, v=noise.normal(size=3), rates=noise.normal(size=3))
    robot = robot.with_own(CAMERAS[0], np.array([1e-3, 2e-3, -1e-3, 3e-3, 0.0]))
    state = SlidingState(robot, np.full(CORE, 1e-4))
    state.age = 2e-3
    turning = np.array([0.3, -0.2, 0.1])
    for _ in range(views):
        state.see(T_BASE_CAMERA, turning, np.eye(6) * 1e-4)
        twist = noise.normal(size=6) * [0.3, 0.3, 0.3, 0.03, 0.03, 0.03]
        R, p = se3.moved(twist, state.robot.R, state.robot.p)
        error = np.zeros(len(state.P))
        error[:6] = twist
        state.move(error)
    far = np.column_stack([noise.uniform(-0.4, 0.4, (points, 2)), np.ones(points)]) * 5
    xyz = far @ state.R[0].T + state.p[0]
    seen = np.einsum("cji,fcj->fci", state.R, xyz[:, None] - state.p)
    return state, seen[..., :2] / seen[..., 2:] + noise.normal(0, 1e-3, (points, views, 2))


def derivative(function, size, step=1e-6):
    columns = [(function(one) - function(-one)) / (2 * step) for one in step * np.eye(size)]
    return np.stack(columns, axis=-1)


def test_derivatives_of_views_are_those_of_differences():
    state, _ = state_with_views()
    before = state.P[:CORE, :CORE].copy()

    def pose(error):
        other, _ = state_with_views()
        other.P[:CORE, :CORE] = before
        other.move(np.concatenate([error, np.zeros(len(other.P) - CORE)]))
        other.see(T_BASE_CAMERA, np.array([0.3, -0.2, 0.1]), np.zeros((6, 6)))
        return other.R[-1], other.p[-1]

    R, p = pose(np.zeros(CORE))

    def twist(error):
        R_moved, p_moved = pose(error)
        turn = R_moved @ R.T
        return se3.log(turn, p_moved - turn @ p)

    J = derivative(twist, CORE)
    state.see(T_BASE_CAMERA, np.array([0.3, -0.2, 0.1]), np.zeros((6, 6)))
    assert np.allclose(state.P[-VIEW:, :CORE], J @ before, atol=1e-6)


def state_with_points():
    """Four points in the first of five views, by a lens that errs, with a random covariance."""
    state, seen = state_with_views()
    found = triangulate(state.R, state.p, seen)
    state.lens = np.array([0.01, 0.02, 0.05, -0.1])
    points = points_of(found.points, state.lens)
    state.add_points(found.host, points, np.zeros((12, len(state.P))), np.eye(12))
    root = np.random.default_rng(6).normal(size=state.P.shape)
    state.P = root @ root.T / len(root)
    return state


def test_derivatives_of_points_in_another_view_are_those_of_differences():
    state, which = state_with_points(), np.arange(4)

    def there(error):
        other = state_with_points()
        other.move(error)
        other.rehost(which, 3)
        return other.points.ravel()

    J, before = derivative(there, len(state.P)), state.P.copy()
    rows = state.rows_of_points(which).ravel()
    state.rehost(which, 3)
    assert np.allclose(state.P[rows, : rows[0]], (J @ before)[:, : rows[0]], atol=1e-5)
    assert np.allclose(state.P[np.ix_(rows, rows)], J @ before @ J.T, atol=1e-4)


def test_points_see_what_the_lens_makes_of_them():
    errors, points = (
        np.array([0.01, 0.02, 0.05, -0.1]),
        np.random.default_rng(8).normal(size=(5, 3)) / 2,
    )
    values, by_point, by_errors = values_of(points, errors)
    assert np.allclose(points_of(values, errors), points, atol=1e-5)
    for n in range(5):
        at = points[n : n + 1]
        J = derivative(lambda x, at=at: values_of(at + x, errors)[0][0], 3)
        assert np.allclose(by_point[n], J, atol=1e-6)
        J = derivative(lambda x, at=at: values_of(at, errors + x)[0][0], 4)
        assert np.allclose(by_errors[n], J, atol=1e-6)


def test_projected_sightings_do_not_depend_on_positions_and_follow_differences():
    state, seen = state_with_views()
    slips = np.random.default_rng(7).normal(size=(*seen.shape, 2))
    found = triangulate(state.R, state.p, seen)
    exact = project(state.R, state.p, found, slips, NOISE)
    x = np.random.default_rng(1).normal(size=34) * 1e-5
    predicted = exact.residual - np.einsum("fkm,m->fk", exact.H, x)
    R, p = se3.moved(x[4:].reshape(5, 6), state.R, state.p)
    again = triangulate(R, p, corrected(seen, slips, x[:4]))
    lengths = np.linalg.norm(project(R, p, again, slips, NOISE).residual, axis=1)
    assert np.allclose(np.linalg.norm(predicted, axis=1), lengths, rtol=1e-3)


def test_a_motion_of_everything_has_no_effect_at_any_estimate():
    state, seen = state_with_views()
    x = np.append(np.zeros(4), np.tile(np.random.default_rng(2).normal(size=6), 5))
    for size in (0.0, 0.3):
        moved = np.random.default_rng(3).normal(size=(5, 6)) * size * 0.05
        R, p = se3.moved(moved, state.R, state.p)
        found = project(R, p, triangulate(R, p, seen), np.ones((*seen.shape, 2)), NOISE)
        assert np.abs(found.H @ x).max() < 1e-8 * np.abs(found.H).max()


def test_corrections_and_gravity_leave_place_and_heading_unknown():
    flight = InertialFlight(4)
    settings = InertialSettings(NOISE, camera=CameraErrors(1e-3, 1e-3, 0.0))
    own = started(flight, settings)
    heading = np.zeros(15)
    heading[5] = 1.0
    four = np.eye(15)[[0, 1, 2, 5]]
    own.state.P[:15, :15] += 1e2 * four.T @ four
    for n in range(11, 45):
        flight.measure(n / 10 + 0.01)
        assert own.see(n * STEP_NS, *flight.see(n / 10), T_BASE_CAMERA)
    assert own.used > 8
    information = np.linalg.inv(own.state.P[:6, :6])[[0, 1, 2, 5]][:, [0, 1, 2, 5]]
    assert np.linalg.eigvalsh(information).max() < 1.02e-2


def started(flight, settings):
    """The filter at one second, after a rest."""
    flight.measure(1.01)
    flight.see(0.0)
    first = start_at_rest(flight.imu, 0, 10 * STEP_NS, settings.imu)
    own = InertialFilter(settings, flight.imu, *first)
    for n in range(1, 11):
        assert own.rest(n * STEP_NS)
    return own


def test_level_flight_leaves_focal_length_and_depths_unknown_at_any_estimate():
    noise = np.random.default_rng(9)
    state, which = SlidingState(RobotState(), np.full(CORE, 1e-10)), np.arange(6)
    for _ in range(4):
        state.see(np.eye(4), np.zeros(3), np.eye(6) * 1e-10)
        step = np.zeros(len(state.P))
        step[:2] = noise.normal(size=2)
        state.move(step)
    state.see(np.eye(4), np.zeros(3), np.eye(6) * 1e-10)
    points = noise.uniform(-0.5, 0.5, (6, 3)) - [0, 0, 1.5]
    state.add_points(which * 0, points, np.zeros((18, len(state.P))), np.eye(18) * 1e-3)
    longer = np.zeros(len(state.P))
    longer[SHAPE.start], longer[state.rows_of_points(which)[:, 2]] = 1, -1
    state.P += 1e2 * np.outer(longer, longer)
    before = longer @ np.linalg.solve(state.P, longer)
    for _ in range(3):
        values = values_of(state.points, state.lens)[0]
        rays = values[:, :2] - values[:, 2:] * state.p[-1, :2] + noise.normal(0, 0.02, (6, 2))
        assert correct_by_points(state, which, rays, np.zeros((6, 2, 2)), 0.01).sum() > 3
    assert np.abs(state.points - points).max() > 0.01
    after = longer @ np.linalg.solve(state.P, longer)
    assert after < 1.001 * before


def flown(seed, readout_s, seconds=9, longer=1.0, jump_rad=0.0):
    """Mean NEES, the error at the end, m, and the filter, for a focal length that is longer."""
    flight = InertialFlight(seed, readout_s=readout_s, jump_rad=jump_rad)
    imu = ImuNoise(4e-4, 3e-3, 0.01, 0.1, 5e-5, 5e-4, 1e-4)
    noise = CornerNoise(0.3 / FOCAL, 1e-5)
    turn = (jump_rad / np.sqrt(0.04), 5.0) if jump_rad else (1e-3, 0.0)
    camera = CameraErrors(1e-3, *turn, FOCAL_SIGMA)
    own = started(flight, InertialSettings(noise, imu=imu, camera=camera, readout=UNKNOWN))
    back, found, error = se3.inverse(flight.pose(0)), [], np.zeros(6)
    for n in range(11, 10 * seconds):
        flight.measure(n / 10 + 0.01)
        ids, rays = flight.see(n / 10)
        rolling = flight.rolling(n / 10)
        assert own.see(n * STEP_NS, ids, rays * longer, T_BASE_CAMERA, rolling=rolling)
        true, robot = back @ flight.pose(n / 10), own.state.robot
        turn = se3.rotation_vector(robot.R @ true[:3, :3].T)
        error = np.concatenate([robot.p - true[:3, 3], turn])
        change = se3.about_itself(robot.p)
        covariance = change @ own.state.P[:6, :6] @ change.T
        found.append(error @ np.linalg.solve(covariance, error))
    return np.mean(found), np.linalg.norm(error[:3]), own


def test_errors_are_as_large_as_they_are_said_to_be_and_the_readout_is_found():
    readouts = [0.0, 0.0, 0.03]
    several = [flown(seed, readout_s) for seed, readout_s in enumerate(readouts)]
    assert 1.5 < np.mean([one[0] for one in several]) < 9
    assert max(one[1] for one in several) < 0.15
    for (_, _, own), true in zip(several, readouts, strict=True):
        assert own.readout.sigma_s < 0.003
        assert abs(own.readout.seconds - true) < 3 * own.readout.sigma_s
        assert (np.abs(own.lens.values) < 3.5 * own.lens.sigmas).all()
        assert own.lens.sigmas[0] < 0.01
        assert not own.lens.fault(INFO, FOCAL_SIGMA)


def test_a_wrong_focal_length_is_found_and_reported():
    nees, off, own = flown(0, 0.0, 7, 1.1)
    assert nees < 12
    assert off < 0.15
    assert own.lens.values[0] == pytest.approx(np.log(1.1), abs=0.02)
    assert own.lens.words(INFO) in own.lens.fault(INFO, FOCAL_SIGMA)
    assert "not 380 px: calibrate" in own.lens.fault(INFO, FOCAL_SIGMA)


@pytest.mark.parametrize("seed", [0, 2])
def test_jumps_of_the_camera_between_images_shift_no_rows(seed):
    own = flown(seed, 0.03, jump_rad=0.005)[2]
    assert abs(own.lens.values[0]) < 3 * own.lens.sigmas[0]
    assert own.readout.seconds == pytest.approx(0.03, abs=0.006)
    assert own.state.lens[1] == pytest.approx(0.03, abs=0.008)


def test_jumps_are_rotations_that_the_state_does_not_expect():
    random = np.random.default_rng(3)
    expected = random.uniform(-0.6, 0.6, (20, 2))
    far = np.column_stack([expected, np.ones(20)])
    true = np.array([0.01, -0.005, 0.02])
    seen = far @ se3.exp(np.append(np.zeros(3), true))[0]
    residual = seen[:, :2] / seen[:, 2:] - expected + random.normal(0, 5e-4, (20, 2))
    residual[3] = 0.3
    assert jump_of(expected, residual, 1e-3, 0.01) == pytest.approx(true, abs=2e-3)
    assert not jump_of(expected[:5], residual[:5], 1e-3, 0.01).any()
    assert not jump_of(expected, residual, 1e-3, largest_jump(CameraErrors(), 0.0)).any()


def test_a_focal_length_is_reported_if_it_is_well_known_and_not_as_expected():
    for off, sigma, is_reported in ((0.031, 0.009, 1), (0.031, 0.011, 0), (0.029, 0.005, 0)):
        found = LensErrors(np.array([off, 0.0]), np.array([sigma, 0.001]))
        assert bool(found.fault(INFO, FOCAL_SIGMA)) == is_reported


@pytest.mark.parametrize(("rate", "is_reported"), [(5, False), (10, True)])
def test_a_focal_length_by_few_images_a_second_is_not_reported(rate, is_reported):
    own = odometry.InertialOdometry(INFO)
    dark = np.zeros((60, 80), np.uint8)
    for number in range(1, 20):
        own.see(number * 10**9 // rate, dark, T_BASE_CAMERA, np.zeros(3))
    assert len(list(own.ready())) == 4  # the others wait for the IMU
    own.filter = SimpleNamespace(lens=LensErrors(np.array([-0.07, 0.0]), np.array([0.01, 0.01])))
    assert bool(own.lens_fault) == is_reported


def test_another_distortion_is_reported():
    bent = LensErrors(np.array([0.0, -0.12]), np.array([0.01, 0.01]))
    assert "lens distortion (k1 differs by -0.12)" in bent.fault(INFO, FOCAL_SIGMA)
    assert not bent.fault(INFO, 0.1)


def test_a_stated_readout_stays():
    state, seen = state_with_views()
    row = READOUTS.start
    state.P[row], state.P[:, row], state.lens[0] = 0, 0, 0.02
    slips = np.ones((*seen.shape, 2))
    projected = project(state.R, state.p, triangulate(state.R, state.p, seen), slips, NOISE)
    state.correct(state.seeing, *together(projected, np.ones(4, bool)))
    assert state.lens[0] == 0.02
    assert not state.P[row].any()


def test_new_points_continue_what_their_sightings_tell():
    state, seen = state_with_views(points=6)
    found = triangulate(state.R, state.p, seen)
    projected = project(state.R, state.p, found, np.zeros((*seen.shape, 2)), NOISE)
    gain, error = state.solve(state.seeing, *together(projected, np.ones(6, bool)))
    state.apply(gain, error)
    begin_points(state, found, projected, np.arange(6), error[state.seeing])
    again = triangulate(state.R, state.p, seen)
    assert np.allclose(values_of(state.points, state.lens)[0], again.points, atol=5e-3)
    assert np.linalg.eigvalsh(state.P).min() > -1e-12
    state.rehost(np.arange(6), 4)
    state.drop_view(0)
    assert (state.host == 3).all()
    assert len(state.P) == CORE + 4 * VIEW + 6 * 3


def test_quantiles_of_chi_squared():
    assert limit(np.array([2, 19]), 2.0) == pytest.approx([7.6, 33.0], rel=0.02)  # 97.7%


def test_a_robot_at_rest_is_level_and_knows_its_bias():
    up = level(np.array([0.0, 3.0, 9.0]))
    assert np.allclose(up @ [0.0, 3.0, 9.0], [0, 0, np.hypot(3, 9)])
    flight = InertialFlight(5)
    own = started(flight, InertialSettings(NOISE))
    bias = flight.bias[:3]
    assert np.allclose(own.state.robot[GYRO], bias, atol=1e-3)
    assert np.linalg.norm(own.state.robot.v) < 0.01
    assert not own.propagate(30 * STEP_NS)  # the IMU has not reached it
    assert own.state.P[MOTION, MOTION].trace() < 1e-3


@pytest.mark.parametrize(("grows", "is_still"), [(0.0, True), (0.2, False)])
def test_a_slow_climb_is_no_rest(grows, is_still):
    """Corners of a camera that looks down, with the noise of optical flow; 20 images a second."""
    random, imu, rest = np.random.default_rng(4), ImuBuffer(), odometry._Rest()
    for n in range(201):
        imu.add(n * 5_000_000, np.zeros(3), np.array([0, 0, 9.81]), MOUNTING)
    ids, small = np.arange(100), np.zeros((48, 64), np.uint8)
    at = random.uniform(-240, 240, (100, 2))
    rest.judge(imu, 0, small, FollowedCorners(ids, at, at))
    for n in range(1, 20):
        far = at * (1 + grows / 240 * n) + random.normal(0, 0.05, at.shape)
        before = at * (1 + grows / 240 * (n - 1)) + random.normal(0, 0.05, at.shape)
        rest.judge(imu, n * 50_000_000, small, FollowedCorners(ids, far, before))
    assert (rest.seconds > odometry._LEAST_STILL_S) is is_still

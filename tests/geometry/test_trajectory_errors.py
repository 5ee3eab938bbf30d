"""ATE and RPE against evo on real trajectories, value by value, and by laws."""

import numpy as np
import pytest
from evo.core import metrics, sync
from evo.core.units import Unit
from evo.tools import file_interface

from ros_visualise.geometry import rotations, se3
from ros_visualise.geometry.trajectory_errors import (
    Delta,
    absolute_errors,
    align,
    associate,
    chain,
    fit_similarity,
    relative_errors,
    statistics,
    step_errors,
)

S = 10**9
UNITS = {"f": Unit.frames, "m": Unit.meters, "deg": Unit.degrees}


def tum(path):
    found = file_interface.read_tum_trajectory_file(path)
    return found, np.rint(found.timestamps * 1e6).astype(np.int64) * 1000


@pytest.fixture(scope="module")
def freiburg(recordings):
    """What evo read, and the stamps."""
    folder = recordings / "trajectory" / "evo"
    truth, estimate = (folder / f"freiburg1_xyz-{n}.txt" for n in ("groundtruth", "rgbdslam"))
    return tum(truth), tum(estimate)


def pair(freiburg, most_s=0.01):
    """(T_truth, T_estimate, stamps of the estimate) of what belongs together, and evo's pair."""
    (truth, truth_ns), (estimate, estimate_ns) = freiburg
    of_truth, of_estimate = associate(truth_ns, estimate_ns, round(most_s * S))
    T_truth, T_estimate = (
        se3.from_pose(one.positions_xyz, np.roll(one.orientations_quat_wxyz, -1, axis=1))
        for one in (truth, estimate)
    )
    evos = sync.associate_trajectories(truth, estimate, max_diff=most_s)
    return T_truth[of_truth], T_estimate[of_estimate], estimate_ns[of_estimate], evos


def evo_statistics(metric, evos):
    metric.process_data(evos)
    return metric.get_all_statistics()


@pytest.mark.parametrize("most_s", [0.01, 0.003, 0.0005])
def test_what_belongs_together_is_what_evo_takes(freiburg, most_s):
    T_truth, T_estimate, stamps_ns, (truth, estimate) = pair(freiburg, most_s)
    np.testing.assert_allclose(stamps_ns / S, estimate.timestamps, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(T_truth[:, :3, 3], truth.positions_xyz)
    np.testing.assert_array_equal(T_estimate[:, :3, 3], estimate.positions_xyz)


@pytest.mark.parametrize("how", ["none", "origin", "se3", "sim3"])
def test_ate_is_evos(freiburg, how):
    T_truth, T_estimate, _, (truth, estimate) = pair(freiburg)
    found = align(T_truth, T_estimate, how)
    if how == "origin":
        estimate.align_origin(truth)
    elif how != "none":
        _, _, scale = estimate.align(truth, correct_scale=how == "sim3")
        assert found.s == pytest.approx(scale, abs=1e-12)
    errors = absolute_errors(T_truth, found.apply(T_estimate))
    for relation, ours in (
        (metrics.PoseRelation.translation_part, errors.translation_m),
        (metrics.PoseRelation.rotation_angle_deg, errors.rotation_deg),
    ):
        expected = evo_statistics(metrics.APE(relation), (truth, estimate))
        assert statistics(ours) == pytest.approx(expected, rel=1e-6, abs=1e-9)


DELTAS = [(1, "f"), (7, "f"), (0.5, "m"), (0.01, "m"), (10, "deg")]


@pytest.mark.parametrize(("amount", "unit"), DELTAS)
def test_rpe_is_evos(freiburg, amount, unit):
    T_truth, T_estimate, stamps_ns, evos = pair(freiburg)
    begins = chain(stamps_ns, T_estimate, Delta(amount, unit))
    errors = relative_errors(T_truth, T_estimate, begins)
    without_attitudes = step_errors(T_truth, T_estimate, begins)
    assert np.isnan(without_attitudes.rotation_deg).all()
    for relation, ours in (
        (metrics.PoseRelation.translation_part, errors.translation_m),
        (metrics.PoseRelation.rotation_angle_deg, errors.rotation_deg),
        (metrics.PoseRelation.point_distance, without_attitudes.translation_m),
    ):
        expected = evo_statistics(metrics.RPE(relation, amount, UNITS[unit]), evos)
        assert statistics(ours) == pytest.approx(expected, rel=1e-6, abs=1e-9)


def random_poses(count, seed=0):
    rng = np.random.default_rng(seed)
    quats = rotations.normalise(rng.normal(size=(count, 4)))
    return se3.from_pose(rng.normal(size=(count, 3)) * 10, quats)


def test_an_alignment_undoes_what_was_done_to_the_truth():
    truth = random_poses(50)
    [other] = random_poses(1, seed=1)
    for how, scale in (("origin", 1.0), ("se3", 1.0), ("sim3", 3.7)):
        moved = other @ truth
        moved[:, :3, 3] *= scale
        found = align(truth, moved, how)
        assert found.s == pytest.approx(1 / scale)
        errors = absolute_errors(truth, found.apply(moved))
        np.testing.assert_allclose(errors.translation_m, 0, atol=1e-9)
        np.testing.assert_allclose(errors.rotation_deg, 0, atol=1e-5)


def test_a_mirror_is_not_taken_for_a_rotation():
    points = random_poses(20)[:, :3, 3]
    found = fit_similarity(points, points * [1, 1, -1], with_scale=False)
    assert np.linalg.det(found.R) == pytest.approx(1)


def test_what_lies_on_a_line_cannot_be_turned():
    truth = random_poses(10)
    truth[:, :3, 3] = np.arange(10)[:, None] * [1.0, 2, 3]
    with pytest.raises(ValueError, match="on a line"):
        align(truth, truth, "se3")
    truth[:, :3, 3] = 5
    with pytest.raises(ValueError, match="on a line"):
        align(truth, truth, "sim3")


def test_relative_errors_know_nothing_of_where_it_began():
    truth, [other] = random_poses(30), random_poses(1, seed=2)
    errors = relative_errors(truth, other @ truth, np.arange(30))
    assert len(errors.translation_m) == 29
    np.testing.assert_allclose(errors.translation_m, 0, atol=1e-9)
    np.testing.assert_allclose(errors.rotation_deg, 0, atol=1e-5)


def test_pairs_of_a_second():
    stamps_ns = np.array([0, 4, 9, 12, 13, 30]) * (S // 10)
    assert chain(stamps_ns, random_poses(6), Delta(1, "s")).tolist() == [0, 3, 5]


def test_equally_near_is_the_earlier_and_none_is_none():
    few, many = np.array([10, 20, 90]), np.array([0, 8, 12, 20, 22])
    for taken, swapped in ((associate(few, many, 5), False), (associate(many, few, 5), True)):
        first, second = reversed(taken) if swapped else taken
        assert (first.tolist(), second.tolist()) == ([0, 1], [1, 3])
    assert associate(np.array([1]), np.array([100]), 5)[0].size == 0


def test_a_rotation_error_is_the_angle_between():
    turned = se3.from_pose(np.zeros((3, 3)), rotations.from_rpy(np.deg2rad(np.eye(3) * 30)))
    errors = absolute_errors(np.eye(4)[None].repeat(3, 0), turned)
    np.testing.assert_allclose(errors.rotation_deg, 30)
    np.testing.assert_allclose(errors.translation_m, 0)

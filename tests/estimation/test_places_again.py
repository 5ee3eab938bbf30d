"""Closures are right or missing, and the way is corrected by as much as they know."""

from itertools import pairwise

import cv2
import numpy as np
import pytest
import visual_flight
from visual_flight import Flight

from ros_visualise.estimation.visual.closing import close_way, edge_errors
from ros_visualise.estimation.visual.corrected import corrected_poses
from ros_visualise.estimation.visual.revisits import Closure, RevisitFinder
from ros_visualise.estimation.visual.stretch import VisualPose
from ros_visualise.estimation.visual.views import SeenPlace
from ros_visualise.geometry import se3, similarity
from ros_visualise.geometry.similarity import Similarity
from ros_visualise.vision.places import PlaceFeatures

NO_FEATURES = PlaceFeatures(np.zeros((0, 2)), np.zeros((0, 32), np.uint8))


# a circle that is flown with errors of a known covariance


def circle(count=40):
    """True poses on a circle, and the end at its start."""
    angles = np.linspace(0, 2 * np.pi, count)
    found = []
    for angle in angles:
        R = cv2.Rodrigues(np.array([0, 0, angle]))[0]
        found.append(Similarity(1.0, R, 5 * np.array([np.cos(angle), np.sin(angle), 0])))
    return found


Q = np.diag([0.02, 0.02, 0.02, 0.004, 0.004, 0.004, 0.01]) ** 2
W = np.diag([0.02] * 3 + [0.004] * 3 + [0.02]) ** 2


def drifted(seed):
    """Poses of an odometry, as places, with scale and pose errors of Q at each edge."""
    random, true = np.random.default_rng(seed), circle()
    poses = [true[0]]
    for a, b in pairwise(true):
        step = similarity.product(similarity.inverse(a), b)
        error = similarity.exp(random.multivariate_normal(np.zeros(7), Q))
        poses.append(similarity.product(poses[-1], similarity.product(step, error)))
    # an odometry has no scale at a pose: its next step is longer instead
    places = [SeenPlace(n, 0, NO_FEATURES, np.zeros((0, 2)), one.R, one.t)
              for n, one in enumerate(poses)]  # fmt: skip
    scale = random.multivariate_normal(np.zeros(7), W)
    motion = similarity.product(similarity.inverse(true[0]), true[-1])
    motion = similarity.product(motion, similarity.exp(scale))
    own = Similarity(motion.s / poses[-1].s, motion.R, motion.t)
    return true, places, Closure(0, len(true) - 1, own, W, 100, 5.0)


def edges(count):
    q = np.repeat(Q[None], count, axis=0)
    q[0] = 0
    return q


def test_a_circle_is_closed_within_its_covariance():
    before, after, squares = [], [], []
    for seed in range(25):
        true, places, closure = drifted(seed)
        way = close_way(places, edges(len(places)), [closure])
        assert way.used == [closure]
        before.append([np.linalg.norm(a.p - b.t) for a, b in zip(places, true, strict=True)])
        after.append([np.linalg.norm(a.t - b.t) for a, b in zip(way.poses, true, strict=True)])
        middle = len(true) // 2
        error = true[middle].t - way.poses[middle].t
        spread = np.eye(6, 7)
        spread[:3, 3:6] = -_cross(way.poses[middle].t)
        spread[:3, 6] = way.poses[middle].t
        P = (spread @ way.covariances[middle] @ spread.T)[:3, :3]
        squares.append(error @ np.linalg.solve(P, error))
    before, after = np.array(before), np.array(after)
    assert np.sqrt((after[:, -1] ** 2).mean()) < 0.2 * np.sqrt((before[:, -1] ** 2).mean())
    assert (after**2).mean() < 0.5 * (before**2).mean()
    assert 1.5 < np.mean(squares) < 5.5  # 3 is right


def _cross(v):
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def test_a_closure_that_the_odometry_contradicts_is_rejected():
    _, places, closure = drifted(3)
    far = closure._replace(second=20)
    way = close_way(places, edges(len(places)), [far])
    assert not way.used
    assert way.rejected == [far]
    assert all((a.t == b.p).all() for a, b in zip(way.poses, places, strict=True))
    both = close_way(places, edges(len(places)), [closure, far])
    assert both.used == [closure]
    alone = close_way(places, edges(len(places)), [closure])
    assert both.poses[-1].t == pytest.approx(alone.poses[-1].t)


def test_a_closure_narrows_the_covariance_most_at_its_end():
    _, places, closure = drifted(5)
    open_way = close_way(places, edges(len(places)), [])
    closed = close_way(places, edges(len(places)), [closure])
    trace = [np.trace(one[:3, :3]) for one in open_way.covariances]
    assert (np.diff(trace) > 0).all()
    narrowed = [np.trace(one[:3, :3]) for one in closed.covariances]
    assert narrowed[-1] < 0.1 * trace[-1]
    assert 0.2 < narrowed[20] / trace[20] < 1


def test_errors_of_edges_add_up_to_the_odometrys():
    true = circle()
    places = [SeenPlace(n, 0, NO_FEATURES, np.zeros((0, 2)), one.R, one.t)
              for n, one in enumerate(true)]  # fmt: skip
    end = np.diag([0.3, 0.3, 0.3, 0.01, 0.01, 0.01]) ** 2
    covariances = np.linspace(0, 1, len(true))[:, None, None] * end
    way = close_way(places, edge_errors(places, covariances), [])
    last = way.covariances[-1]
    assert np.trace(last[3:6, 3:6]) == pytest.approx(3 * 0.01**2, rel=1e-6)


OWN = np.diag([0.01] * 3 + [0.002] * 3) ** 2
COMMON = 0.03


def measured(seed):
    """A way with an image between each two keyframes, all of it too large by one factor.

    The true poses of the images, what the odometry says of them, and the closed way.
    """
    true, places, closure = drifted(seed)
    random = np.random.default_rng(1000 + seed)
    factor = np.exp(random.normal(0, COMMON))
    for one in places:
        one.stamp_ns, one.p = 2 * one.stamp_ns, one.p * factor
    motion = closure.motion._replace(t=closure.motion.t * factor)
    way = close_way(places, edges(len(places)), [closure._replace(motion=motion)])
    steps = np.cumsum(edges(len(places))[:, :6, :6], axis=0)  # which only differences count of
    found, exact = [], []
    for n, one in enumerate(places):
        found.append(VisualPose(2 * n, one.R, one.p, steps[n], True))
        exact.append(true[n])
        if n + 1 < len(places):
            half = similarity.exp(0.5 * similarity.log(
                similarity.product(similarity.inverse(true[n]), true[n + 1])))  # fmt: skip
            error = similarity.exp(np.append(random.multivariate_normal(np.zeros(6), OWN), 0))
            a, b = places[n], places[n + 1]
            seen = similarity.exp(0.5 * similarity.log(similarity.product(
                similarity.inverse(Similarity(1.0, a.R, a.p)), Similarity(1.0, b.R, b.p),
            )))  # fmt: skip
            at = similarity.product(
                similarity.product(Similarity(1.0, a.R, a.p), seen), error)  # fmt: skip
            ahead = se3.adjoint(at.R, at.t)
            own = steps[n] + ahead @ OWN @ ahead.T
            found.append(VisualPose(2 * n + 1, at.R, at.t, own, True))
            exact.append(similarity.product(true[n], half))
    return exact, corrected_poses(found, places, way, COMMON)


def test_corrected_poses_are_as_far_off_as_their_covariances_say():
    squares, between = [], []
    for seed in range(25):
        exact, poses = measured(seed)
        for n, (true, pose) in enumerate(zip(exact, poses, strict=True)):
            turn = se3.rotation_vector(true.R @ pose.R.T)
            about = se3.about_itself(pose.p)
            error = np.concatenate([true.t - pose.p, turn])
            if n > 6:
                P = about @ pose.covariance @ about.T
                (between if n % 2 else squares).append(error @ np.linalg.solve(P, error))
    assert 4 < np.mean(squares) < 8  # 6 is right
    assert 4 < np.mean(between) < 8


def test_the_scale_that_all_lengths_share_stays_unknown():
    _, poses = measured(3)
    far = max(poses, key=lambda one: float(np.linalg.norm(one.p)))
    along = far.p / np.linalg.norm(far.p)
    about = se3.about_itself(far.p)
    P = about @ far.covariance @ about.T
    assert along @ P[:3, :3] @ along > (COMMON * np.linalg.norm(far.p)) ** 2


# images of a drawn ground


def looked(numbers, flight=None, stretches=None, units=None):
    """A finder with the keyframes of images, at their true poses."""
    flight = flight or Flight()
    finder = RevisitFinder(flight.info.K)
    for k, number in enumerate(numbers):
        finder.add(k, stretches[k] if stretches else 0, flight.image(number))
        unit = units[k] if units else 1.0
        place = finder.places[-1]
        place.R, place.p = flight.R(number), unit * flight.p(number)
    return finder


def test_a_flight_back_is_closed_where_it_was():
    numbers = [*range(0, 30, 2), *range(27, 7, -2)]
    flight, finder = Flight(), looked(numbers)
    closures = finder.find()
    assert len(closures) > 4
    for one in closures:
        R, p = flight.motion(numbers[one.first], numbers[one.second])
        assert np.linalg.norm(one.motion.t - p) < 0.06
        assert np.trace(one.motion.R.T @ R) > 2.998
        assert one.motion.s == pytest.approx(1.0, abs=0.04)


def test_a_flight_that_never_returns_is_not_closed():
    assert looked(range(0, 80, 4)).find() == []


def test_a_map_of_other_units_is_known_by_three_keyframes():
    numbers = [*range(0, 40, 2), *range(25, 11, -2)]
    parts = [0] * 20 + [1] * 7
    finder = looked(numbers, stretches=parts, units=[1.0] * 20 + [0.25] * 7)
    closures = finder.find()
    assert len(closures) >= 3
    assert [one.motion.s for one in closures] == pytest.approx([4.0] * len(closures), rel=0.05)
    covariances = np.zeros((27, 6, 6)) + 1e-4 * np.eye(6)
    way = close_way(finder.places, edge_errors(finder.places, covariances), closures)
    assert len(way.used) == len(closures)
    for number, pose in zip(numbers[20:], way.poses[20:], strict=True):
        assert np.linalg.norm(pose.t - Flight().p(number)) < 0.12


def test_a_pattern_that_repeats_is_no_place(monkeypatch):
    period = 120  # pixels of the texture: 2 m
    tile = cv2.GaussianBlur(visual_flight._texture()[:period, :period], (0, 0), 1)
    tiled = np.tile(tile, (960 // period + 1, 1200 // period + 1))[:960, :1200]
    monkeypatch.setattr(visual_flight, "_texture", lambda: tiled)
    finder = looked(range(0, 90, 3))
    closures = finder.find()
    covariances = np.linspace(0, 1, 30)[:, None, None] * np.diag([0.1] * 3 + [0.01] * 3) ** 2
    way = close_way(finder.places, edge_errors(finder.places, covariances), closures)
    flight = Flight()
    for one in way.used:
        _, p = flight.motion(3 * one.first, 3 * one.second)
        assert np.linalg.norm(one.motion.t - p) < 0.3
    assert finder.ambiguous + len(way.rejected) > 5

"""The navigator over known tags: how exact it is, how honest, and what it refuses."""

from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from flights import T_BASE_CAMERA, Flight, field_of_tags, lawn_mower
from seeds import mean_band

from ros_visualise.estimation.camera_view import view_of
from ros_visualise.estimation.landmark import KnownLandmark
from ros_visualise.estimation.landmark_map import MapMode, MapRules
from ros_visualise.estimation.navigator import Navigator
from ros_visualise.estimation.odometry import OdometryNoise
from ros_visualise.estimation.settings import NavigatorSettings
from ros_visualise.geometry import rigid, se3
from ros_visualise.geometry.se3 import turn_between

LEVEL = np.radians(0.5)
NOISE = OdometryNoise(0.01, 0.0, 0.0, 0.02, 0.003, 0.0, 0.0, 0.0)
FROZEN = NavigatorSettings(MapRules(MapMode.FROZEN), NOISE, level_rad=LEVEL)
BUILD = NavigatorSettings(MapRules(MapMode.BUILD), NOISE, level_rad=LEVEL)
EXACT = np.eye(6) * 1e-8


@cache
def flight(seed=1, length_m=60.0):
    """A short one over tags, and all that is told on it."""
    tags = field_of_tags(np.random.default_rng(seed), 64, 24, 30)
    points = lawn_mower(length_m, row_m=24.0)
    one = Flight(tags, points, seed, odom_hz=10, images_hz=2.5, level_rad=LEVEL)
    return one, tuple(one.told())


def known(tags, sigma=0.0):
    return {
        f"tag36h11_{id}": KnownLandmark.of(
            tag.T[:3, :3], tag.T[:3, 3], EXACT + np.eye(6) * sigma**2, tag.side_m
        )
        for id, tag in tags.items()
    }


def error(one, number, now):
    """(6,) of the position, and of turns there."""
    T = one.true_pose(number)
    turned = turn_between(T[:3, :3], now.T_map_base[:3, :3])
    return np.concatenate([T[:3, 3] - now.T_map_base[:3, 3], turned])


def fly(navigator, one, told, change=lambda seen: seen, late=0, watch=lambda outcome: None):
    """Errors (N, 6) and covariances while it is located; images come so many odometries later.

    ``change`` makes other detections of those seen, ``watch`` is given what becomes of each image.
    """
    found, waiting = [], []
    for number, stamp, pose, seen in told:
        now = navigator.odometry(stamp, pose)
        if seen is not None:
            waiting.append((number + late, view_of(change(seen), T_BASE_CAMERA)))
        while waiting and waiting[0][0] <= number:
            navigator.see(waiting.pop(0)[1])
            watch(navigator.outcome)
        if now is not None and now.is_located:
            found.append((error(one, number, now), now.covariance))
    errors, covariances = zip(*found, strict=True)
    return np.array(errors), np.array(covariances)


def off_by(tag, twist):
    R, p = se3.moved(twist, tag.R, tag.p)
    return replace(tag, R=R, p=p)


def ate(errors):
    return float(np.sqrt((errors[:, :3] ** 2).sum(axis=1).mean()))


def assert_within(error, covariance):
    """That a position's error is one of the 999 of 1000 that its covariance expects."""
    off = error[:3]
    assert off @ np.linalg.solve(covariance[:3, :3], off) < 16.27


def displaced(told, motion):
    """The same with an odometry that is elsewhere by a motion."""
    return [(n, stamp, rigid.compose(motion, pose), seen) for n, stamp, pose, seen in told]


def test_it_is_located_by_a_known_map_far_better_than_by_its_odometry():
    one, told = flight()
    navigator = Navigator(FROZEN, known(one.tags))
    errors, covariances = fly(navigator, one, told)
    assert len(errors) > 0.9 * len(told)
    assert ate(errors) < 0.08
    nees = [e @ np.linalg.solve(P, e) for e, P in zip(errors, covariances, strict=True)]
    assert 2 < np.mean(nees) < 12  # one flight; the benchmark looks at thirty
    assert navigator.counts["losses"] == 0


def test_over_a_map_that_is_off_as_a_whole_it_is_as_sure_as_it_says():
    one, told = flight()
    spread = np.diag([0.3, 0.3, 0.1, 0.002, 0.002, 0.01]) ** 2
    random, nees = np.random.default_rng(2), []
    for _ in range(4):
        twist = random.normal(0, np.sqrt(np.diag(spread)))
        there = {name: off_by(tag, twist) for name, tag in known(one.tags).items()}
        errors, covariances = fly(Navigator(FROZEN, there, common=spread), one, told[:60])
        squares = np.einsum(
            "ni,ni->n", errors, np.linalg.solve(covariances, errors[..., None])[..., 0]
        )
        nees.append(squares.mean())
    low, high = mean_band(6, len(nees))
    assert low < np.mean(nees) < high


def test_images_that_come_late_are_put_in_at_their_own_time():
    one, told = flight()
    at_once, _ = fly(Navigator(FROZEN, known(one.tags)), one, told)
    late, _ = fly(Navigator(FROZEN, known(one.tags)), one, told, late=3)
    assert ate(late) < ate(at_once) + 0.05  # known later, but as well


def test_a_moved_tag_is_refused_and_not_believed():
    one, told = flight()
    there = known(one.tags)
    often = Counter(d.id for *_, seen in told if seen for d in seen.detections)
    moved = f"tag36h11_{often.most_common(1)[0][0]}"
    there[moved] = replace(there[moved], p=there[moved].p + np.array([1.0, 0, 0]))
    outcome = []
    errors, _ = fly(Navigator(FROZEN, there), one, told, watch=outcome.append)
    assert ate(errors) < 0.2
    assert any(moved in image.rejected for image in outcome)
    assert not any(moved in image.used for image in outcome[5:])


def test_a_tag_of_another_size_than_the_map_says_is_refused():
    one, told = flight()
    navigator = Navigator(FROZEN, known(one.tags))

    def shrink(seen):
        several = [replace(d, side_m=d.side_m / 2) for d in seen.detections]
        return replace(seen, detections=tuple(several[:1] + list(seen.detections[1:])))

    errors, _ = fly(navigator, one, told, shrink)
    assert ate(errors) < 0.2
    assert any("in the map" in why for why in navigator.outcome.rejected.values())


def test_two_tags_of_one_name_in_an_image_are_both_refused():
    one, told = flight()
    navigator = Navigator(FROZEN, known(one.tags))

    def twice(seen):
        return replace(seen, detections=(*seen.detections[:1], *seen.detections))

    errors, _ = fly(navigator, one, told, twice)
    assert ate(errors) < 0.2
    assert "duplicate in the image" in navigator.outcome.rejected.values()


def test_a_frozen_camera_makes_it_no_surer():
    one, told = flight()
    navigator = Navigator(FROZEN, known(one.tags))
    half = len(told) // 2
    fly(navigator, one, told[:half])
    last = next(seen for *_, seen in reversed(told[:half]) if seen is not None)
    before = np.trace(navigator.state.P[:3, :3])
    errors, covariances = fly(
        navigator, one, told[half:], lambda seen: replace(last, header=seen.header)
    )
    assert navigator.counts["frozen"] > 10
    assert np.trace(covariances[-1][:3, :3]) > before
    assert_within(errors[-1], covariances[-1])


def test_a_kidnapped_robot_is_noticed_said_and_found_again():
    one, told = flight()
    navigator = Navigator(FROZEN, known(one.tags))
    third = len(told) // 3
    fly(navigator, one, told[:third])
    # carried to where it was to be a third of the way later, while the odometry notices nothing
    carried = rigid.compose(told[third][2], rigid.inverse(told[2 * third][2]))
    errors, _ = fly(navigator, one, displaced(told[2 * third :], carried))
    assert (navigator.counts["losses"], navigator.counts["recovered"]) == (1, 1)
    assert np.linalg.norm(errors[-1][:3]) < 0.2
    said = navigator.news()
    assert sum("lost" in text for text in said) == sum("relocalized" in text for text in said) == 1
    assert not navigator.news()


def test_an_odometry_that_jumps_costs_the_place_until_tags_tell_it():
    one, told = flight()
    navigator = Navigator(FROZEN, known(one.tags))
    half = len(told) // 2
    fly(navigator, one, told[:half])
    after = displaced(told[half:], (500.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    _, stamp, pose, _ = after[0]
    assert not navigator.odometry(stamp, pose).is_located
    errors, _ = fly(navigator, one, after[1:])
    assert np.linalg.norm(errors[-1][:3]) < 0.2


def test_a_clock_that_is_set_back_begins_anew():
    one, told = flight()
    navigator = Navigator(FROZEN, known(one.tags))
    fly(navigator, one, told)
    errors, _ = fly(navigator, one, told)
    assert ate(errors) < 0.08


def test_while_nothing_is_seen_it_goes_on_by_the_odometry_and_grows_less_sure():
    one, told = flight()
    navigator = Navigator(FROZEN, known(one.tags))
    half = len(told) // 2
    fly(navigator, one, told[:half])
    blind = [(number, stamp, pose, None) for number, stamp, pose, _ in told[half:]]
    errors, covariances = fly(navigator, one, blind)
    assert len(errors) == len(blind)
    sizes = [np.trace(P[:3, :3]) for P in covariances]
    assert sizes == sorted(sizes)
    assert_within(errors[-1], covariances[-1])


def test_map_to_odom_takes_the_odometry_to_the_robot():
    one, told = flight()
    navigator = Navigator(FROZEN, known(one.tags))
    for _, stamp, pose, seen in told[:40]:
        now = navigator.odometry(stamp, pose)
        if now is not None:
            assert now.stamp_ns == stamp
            there = now.T_map_odom @ rigid.to_matrix(pose)
            np.testing.assert_allclose(there, now.T_map_base, atol=1e-9)
        if seen is not None:
            navigator.see(view_of(seen, T_BASE_CAMERA))
    assert now is not None


@pytest.mark.parametrize("mode", [MapMode.FROZEN, MapMode.EXTEND])
def test_without_a_landmark_nothing_is_known_of_the_place(mode):
    one, told = flight()
    navigator = Navigator(replace(FROZEN, rules=MapRules(mode)), known(one.tags))
    assert all(navigator.odometry(stamp, pose) is None for _, stamp, pose, _ in told)


def positions(navigator, one):
    """Of the landmarks that are used: where they are believed to be, and where they are."""
    state, used = navigator.state, navigator.map.used
    found = state.landmarks_p[state.indices([landmark.key for landmark in used])]
    ids = [int(landmark.name.rpartition("_")[2]) for landmark in used]
    return found, np.array([one.tags[id].T[:3, 3] for id in ids])


def aligned(found, true):
    """Turned and shifted onto the truth: how level a new map is nobody tells."""
    a, b = found - found.mean(axis=0), true - true.mean(axis=0)
    U, _, V = np.linalg.svd(a.T @ b)
    return a @ U @ np.diag([1, 1, np.linalg.det(U @ V)]) @ V + true.mean(axis=0)


def test_a_map_is_built_in_one_pass():
    one, told = flight()
    navigator = Navigator(BUILD)
    errors, covariances = fly(navigator, one, told)
    found, true = positions(navigator, one)
    assert len(found) > 10
    assert np.sqrt(((aligned(found, true) - true) ** 2).sum(axis=1).mean()) < 0.05
    assert_within(errors[-1], covariances[-1])


def test_a_map_is_extended_by_the_tags_that_it_lacks():
    one, told = flight()
    some = dict(list(known(one.tags).items())[::2])
    navigator = Navigator(replace(FROZEN, rules=MapRules(MapMode.EXTEND)), some)
    errors, _ = fly(navigator, one, told)
    assert ate(errors) < 0.1
    found, true = positions(navigator, one)
    assert len(found) > len(some.keys() & navigator.map.landmarks.keys())
    assert np.linalg.norm(found - true, axis=1).max() < 0.1


def test_a_tag_of_another_size_than_said_gets_into_no_map():
    one, told = flight()
    often = Counter(d.id for *_, seen in told if seen for d in seen.detections)
    wrong = often.most_common(1)[0][0]

    def mislabel(seen):
        """The detector believes it to be a fifth smaller, and so nearer."""
        several = []
        for found in seen.detections:
            if found.id == wrong:
                nearer = [replace(h, position_xyz=h.position_xyz * 0.8) for h in found.hypotheses]
                several.append(replace(found, side_m=found.side_m * 0.8, hypotheses=tuple(nearer)))
            else:
                several.append(found)
        return replace(seen, detections=tuple(several))

    navigator, outcome = Navigator(BUILD), []
    errors, covariances = fly(navigator, one, told, mislabel, watch=outcome.append)
    assert not any(f"tag36h11_{wrong}" in image.used for image in outcome)
    assert any(f"tag36h11_{wrong}" in image.rejected for image in outcome)
    assert_within(errors[-1], covariances[-1])


def test_images_without_an_odometry_do_not_pile_up():
    one, told = flight()
    navigator = Navigator(FROZEN, known(one.tags))
    views = [view_of(seen, T_BASE_CAMERA) for *_, seen in told if seen is not None]
    for view in views * 4:
        assert not navigator.see(view)
    assert navigator.dropped["images of camera 1: no odometry"] == 4 * len(views) - 100

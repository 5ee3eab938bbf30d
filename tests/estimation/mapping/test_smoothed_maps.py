"""Maps from worlds of which all is known."""

from dataclasses import replace

import numpy as np
import pytest
from made_worlds import SIZE, drifting, flight, floor, turn, world

from ros_visualise.estimation.mapping.mapping import map_of
from ros_visualise.estimation.mapping.outliers import outliers
from ros_visualise.estimation.mapping.problem import DistancePrior, TagPrior
from ros_visualise.estimation.mapping.smoothing import smooth
from ros_visualise.estimation.mapping.unknowns import LARGER, PRINTED, MeasurementNoise, SharedPrior
from ros_visualise.geometry.se3 import from_parts, inverse, rotation_vector

TAGS, VIEWS, SIGMA_PX = 7, 30, 0.2
NOISE = MeasurementNoise(extra_px=SIGMA_PX)


@pytest.fixture
def random():
    return np.random.default_rng(4)


@pytest.fixture
def tags(random):
    return floor(random, TAGS, 4.0)


@pytest.fixture
def cameras(random):
    return flight(random, VIEWS, 4.0)


def errors(found, tags):
    """(M, 6) of the tags' poses, and their squared distances by the covariances, in the map."""
    numbers = [int(name.split("_")[1].split()[0]) for name in found.problem.names]
    is_fixed = found.problem.odometry or found.problem.surveyed
    true = tags if is_fixed else inverse(tags[numbers[found.problem.anchor]]) @ tags
    off = np.array(
        [
            np.concatenate([t - true[n][:3, 3], rotation_vector(R @ true[n][:3, :3].T)])
            for R, t, n in zip(*found.tags, numbers, strict=True)
        ]
    )
    return off, [e @ np.linalg.solve(P, e) for e, P in zip(off, found.covariances, strict=True)]


def test_exact_corners_give_the_exact_map(random, cameras, tags):
    found = smooth(world(random, cameras, tags))
    assert found.inliers.all()
    assert np.abs(errors(found, tags)[0]).max() < 1e-6


def test_a_tag_that_begins_turned_over_is_turned_back_by_its_views(random, cameras, tags):
    problem = world(random, cameras, tags, SIGMA_PX)
    for one in problem.sightings:
        one.hypotheses.reverse()  # the likelier reading of each picture is the wrong one
    right = smooth(world(np.random.default_rng(4), cameras, tags, SIGMA_PX), NOISE)
    found = smooth(problem, NOISE)
    assert np.abs(errors(found, tags)[0]).max() < 2 * np.abs(errors(right, tags)[0]).max() + 0.02


def test_odometry_ties_tags_that_are_never_seen_together(random, cameras, tags):
    far = tags.copy()
    far[:, 0, 3] *= 8
    long = flight(random, VIEWS, 32.0)
    apart = smooth(world(random, long, far, SIGMA_PX))
    told = drifting(random, long, NOISE)
    found = smooth(world(random, long, far, SIGMA_PX, odometry=told), NOISE)
    assert apart is None or len(apart.tags.t) < len(found.tags.t)
    off, distances2 = errors(found, far)
    assert np.mean(distances2) < 12
    assert np.abs(off[:, :3]).max() < 1.0


def test_noise_is_estimated(random, cameras, tags):
    told = drifting(random, cameras, MeasurementNoise(way_m=0.06, tilt_rad=0.004, heading_rad=0.02))
    found = smooth(world(random, cameras, tags, 0.3, odometry=told))
    assert found.noise.extra_px[0] == pytest.approx(0.3, abs=0.1)
    assert found.noise.way_m == pytest.approx(0.06, rel=0.5)
    assert found.noise.heading_rad == pytest.approx(0.02, rel=0.6)


def test_tags_that_are_seen_too_large_are_noticed(random, cameras, tags):
    told = drifting(random, cameras, MeasurementNoise(way_m=1e-3))
    problem = world(random, cameras, tags, 0.05, odometry=told, larger_px=0.4)
    found = smooth(problem, MeasurementNoise(extra_px=0.05, way_m=1e-3))
    sigma = np.sqrt(found.shared_covariance[LARGER, LARGER])
    assert found.shared[LARGER] == pytest.approx(0.4, abs=3 * sigma)
    assert sigma < 0.1


def test_a_survey_gives_the_map_its_frame_and_bends_it(random, cameras, tags):
    T = from_parts(turn([0.1, 0.2, 2.0]), [10.0, -4.0, 1.0])
    problem = world(random, cameras, tags, SIGMA_PX)
    known = [TagPrior(n, (T @ tags[n])[:3, 3], np.full(3, 1e-3)) for n in (0, 3, 6)]
    found = smooth(type(problem)(*_parts(problem), None, known), NOISE)
    off, _ = errors(found, T @ tags)
    assert np.abs(off[[0, 3, 6], :3]).max() < 0.003
    assert np.abs(off[:, :3]).max() < 0.05


def test_a_survey_tells_how_large_tags_were_printed(random, cameras, tags):
    problem = world(random, cameras, tags, 0.1, size_of=lambda _: 1.02 * SIZE)
    known = [TagPrior(n, tags[n][:3, 3], np.full(3, 1e-3)) for n in (0, 2, 4, 6)]
    measured = type(problem)(*_parts(problem), None, known)
    found = smooth(measured, MeasurementNoise(extra_px=0.1), SharedPrior(printed=0.05))
    assert found.shared[PRINTED] == pytest.approx(0.02, abs=0.005)


def test_a_distance_that_was_measured_holds(random, cameras, tags):
    problem = world(random, cameras, tags, SIGMA_PX)
    far = [DistancePrior((0, 6), 4.5, 1e-3)]
    found = smooth(type(problem)(*_parts(problem), None, [], far), NOISE)
    assert np.linalg.norm(found.tags.t[6] - found.tags.t[0]) == pytest.approx(4.5, abs=0.02)


def test_a_mislabelled_size_is_named_and_set_right(random, cameras, tags):
    problem = world(random, cameras, tags, 0.1, size_of=lambda n: 0.42 if n == 2 else SIZE)
    made = map_of(problem)
    [wrong] = [one for one in made.outliers if one.kind != "unsteady"]
    assert (wrong.name, wrong.kind) == ("tag36h11_2", "size")
    assert wrong.value * SIZE == pytest.approx(0.42, rel=0.02)
    [track] = [one for one in made.tracks if one.name == "tag36h11_2"]
    assert track.size_xyz[0] == pytest.approx(0.42, rel=0.02)
    assert np.abs(errors(made.smoothed, tags)[0][:, :3]).max() < 0.05


def test_a_tag_that_was_moved_is_where_it_was_last(random, tags):
    there_and_back = np.concatenate([flight(random, VIEWS, 4.0), flight(random, VIEWS, 4.0)[::-1]])
    moved = tags[3].copy()
    moved[:3, 3] += [0.3, 0.5, 0]
    problem = world(
        random,
        there_and_back,
        tags,
        0.1,
        place_of=lambda n, view: moved if n == 3 and view >= VIEWS else tags[n],
    )
    made = map_of(problem)
    [wrong] = made.outliers
    assert (wrong.name, wrong.kind) == ("tag36h11_3", "moved")
    assert wrong.value == pytest.approx(np.hypot(0.3, 0.5), abs=0.05)
    now = tags.copy()
    now[3] = moved
    off, _ = errors(made.smoothed, np.concatenate([now, tags[3:4]]))
    assert np.abs(off[made.smoothed.problem.names.index("tag36h11_3"), :3]).max() < 0.05
    assert not any("elsewhere" in one.name for one in made.tracks)


def test_an_id_that_is_there_twice_is_named(random):
    tags, cameras = floor(random, TAGS, 4.0), flight(random, VIEWS, 4.0)
    other = tags[3].copy()
    other[:3, 3] += [1.2, 0.6, 0]
    problem = world(
        random,
        cameras,
        tags,
        0.1,
        place_of=lambda n, _: [tags[3], other] if n == 3 else tags[n],
    )
    made = map_of(problem)
    [wrong] = made.outliers
    assert (wrong.name, wrong.kind) == ("tag36h11_3", "twice")
    assert wrong.value == pytest.approx(np.hypot(1.2, 0.6), abs=0.1)


def test_a_tag_that_the_search_threw_away_is_not_there_twice(random, cameras, tags):
    found = smooth(world(random, cameras, tags, 0.1))
    far = found.tags.t.copy()
    far[3] += [5e4, 0, 0]
    is_other = np.array([one.tag != 3 for one in found.problem.sightings])
    thrown = replace(found, tags=found.tags._replace(t=far), inliers=found.inliers & is_other)
    assert [(one.name, one.kind) for one in outliers(thrown)] == [("tag36h11_3", "astray")]


def test_wild_corners_are_refused(random, cameras, tags):
    problem = world(random, cameras, tags, 0.1)
    wild = random.choice(len(problem.sightings), len(problem.sightings) // 12, replace=False)
    for row in wild:
        problem.sightings[row].corners_uv[random.integers(4)] += [15.0, -9.0]
    found = smooth(problem)
    assert not found.inliers[wild].any()
    assert np.delete(found.inliers, wild).mean() > 0.95
    assert np.abs(errors(found, tags)[0][:, :3]).max() < 0.05


def _parts(problem):
    return problem.stamps_ns, problem.names, problem.sightings

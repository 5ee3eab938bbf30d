"""Whether landmarks are as sure as the localizer says, by passes of which all is known."""

import math

import numpy as np
import pytest
from made_passes import (
    detections,
    direction_seen,
    looking,
    misled,
    tag_noise,
    tag_seen,
    turn,
)
from seeds import mean_band, runs

from ros_visualise.estimation.localization.localizer import Localizer, LocalizerRules
from ros_visualise.estimation.localization.robot_error import ErrorModel
from ros_visualise.estimation.localization.seen import Ground
from ros_visualise.geometry.se3 import turn_between

RUNS = 60
FOREVER = 1e9
MODEL = ErrorModel(0.1, math.radians(1.5), FOREVER, FOREVER)
DEVIATIONS = np.repeat([MODEL.position_m, MODEL.attitude_rad], 3)
GROUND = Ground(np.array([0, 0, 1.0]), 0.0, 0.1)


def passed(random, views=12, tag=False, model=MODEL, redraw_every=0):
    """The error of a landmark (6,) and its covariance, after a pass with one error of the robot."""
    localizer, rules = Localizer(), LocalizerRules(errors=model, ground=GROUND)
    error = DEVIATIONS * random.standard_normal(6)
    R = turn(0.3 * random.standard_normal(3))
    position = np.array([2.0, 1, 0 if tag else GROUND.sigma_m * random.standard_normal()])
    for number in range(views):
        if redraw_every and number % redraw_every == 0:
            error = DEVIATIONS * random.standard_normal(6)
        camera = np.array([-8 + 12 * number / views, -3, 6.0])
        T = looking(camera, position + random.standard_normal(3))
        if tag:
            noise = tag_noise(np.linalg.norm(position - camera))
            seen = tag_seen(T, position, R, noise, random)
        else:
            seen = direction_seen(T, position, 0.003, random)
        localizer.observe(detections(number / 10, [seen]), misled(T, error), rules)
    (track,) = localizer.landmarks.values()
    off = [track.best.position_xyz - position, turn_between(track.best.R_fixed_landmark, R)]
    return np.concatenate(off), track.covariance


def mean_squared_distance(size, **how):
    found = [passed(np.random.default_rng(seed), **how) for seed in range(RUNS)]
    return np.mean([e[:size] @ np.linalg.solve(P[:size, :size], e[:size]) for e, P in found])


@pytest.mark.parametrize(("tag", "size"), [(True, 6), (False, 3)])
def test_errors_are_as_large_as_their_covariance_says(tag, size):
    low, high = mean_band(size, RUNS)
    assert low < mean_squared_distance(size, tag=tag) < high


@pytest.mark.parametrize(("tag", "size"), [(True, 6), (False, 3)])
def test_errors_that_are_forgotten_from_view_to_view_are_so_too(tag, size):
    model = ErrorModel(MODEL.position_m, MODEL.attitude_rad, 1e-3, 1e-3)
    low, high = mean_band(size, RUNS)
    assert low < mean_squared_distance(size, tag=tag, model=model, redraw_every=1) < high


def test_who_takes_one_error_for_many_is_far_too_sure():
    model = ErrorModel(MODEL.position_m, MODEL.attitude_rad, 1e-3, 1e-3)
    assert mean_squared_distance(3, model=model) > 2 * mean_band(3, RUNS)[1]


def test_ten_views_with_one_attitude_error_are_not_ten_votes():
    once = passed(np.random.default_rng(1), views=3)[1]
    often = passed(np.random.default_rng(1), views=60)[1]
    assert np.trace(often[:2, :2]) > 0.25 * np.trace(once[:2, :2])
    model = ErrorModel(MODEL.position_m, MODEL.attitude_rad, 1e-3, 1e-3)
    new = passed(np.random.default_rng(1), views=60, model=model, redraw_every=1)[1]
    assert np.trace(new[:2, :2]) < 0.1 * np.trace(once[:2, :2])


def test_tags_seen_on_the_way_back_have_not_moved():
    """The scale error shrinks there: the covariance hardly grows, but the random walk goes on."""
    walk, scale, elsewhere = 0.02, 0.005, 0
    count = runs(6, of=20)
    for seed in range(count):
        random = np.random.default_rng(seed)
        localizer, longer, error = Localizer(), scale * random.standard_normal(), np.zeros(3)
        for step in range(400):
            x = 0.2 * (step if step < 200 else 400 - step)
            error += walk * math.sqrt(0.2) * random.standard_normal(3)
            of_scale = np.array([x, 0, 0])
            sigmas2 = np.append(walk**2 * 0.2 * (step + 1) + (scale * of_scale) ** 2, [1e-6] * 3)
            T = looking(np.array([x, 0, 4.0]), np.array([x, 0.01, 0]))
            seen = [tag_seen(T, np.array([8.0, 0, 0]), turn([0, 0, 0]), tag_noise(4), random)]
            wrong = misled(T, np.append(-error - longer * of_scale, np.zeros(3)))
            found = seen if step > 200 and abs(x - 8) < 2 else []
            localizer.observe(
                detections(step / 10, found), wrong, LocalizerRules(), np.diag(sigmas2)
            )
        elsewhere += localizer.skipped["elsewhere"]
    assert elsewhere < 5 / 20 * count

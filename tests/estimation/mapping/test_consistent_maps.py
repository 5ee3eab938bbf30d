"""Whether the map is as sure as it says: errors of landmarks by their covariances, over worlds."""

import numpy as np
import pytest
from made_worlds import drifting, flight, floor, turn, world
from seeds import mean_band, runs

from ros_visualise.estimation.mapping.priors import FIRST
from ros_visualise.estimation.mapping.smoothing import smooth
from ros_visualise.estimation.mapping.unknowns import MeasurementNoise
from ros_visualise.geometry.se3 import from_parts, inverse, rotation_vector, turn_between

SEEDS = runs(8, of=16)
NOISE = MeasurementNoise(extra_px=0.2)


def begun_wrong(random, told):
    """The same frames, as wrong at the first view as they are trusted to be."""
    error = FIRST * random.standard_normal(6)
    R, at = turn(error[3:]), told[0, :3, 3]
    return from_parts(R, at + error[:3] - R @ at) @ told


def squared_distance(seed):
    """Of the error of one tag of a world by its covariance: six numbers."""
    random = np.random.default_rng(seed)
    tags, cameras = floor(random, 4, 3.0), flight(random, 12, 3.0)
    told = begun_wrong(random, drifting(random, cameras, NOISE))
    found = smooth(world(random, cameras, tags, 0.2, odometry=told), NOISE)
    number = int(random.integers(len(found.tags.t)))
    true = tags[int(found.problem.names[number].split("_")[1])]
    R, t = found.tags.R[number], found.tags.t[number]
    error = np.concatenate([t - true[:3, 3], rotation_vector(R @ true[:3, :3].T)])
    return float(error @ np.linalg.solve(found.covariances[number], error))


def test_landmarks_are_as_sure_as_they_say():
    low, high = mean_band(6, SEEDS)
    assert low < np.mean([squared_distance(seed) for seed in range(SEEDS)]) < high


@pytest.mark.parametrize("lasting", [0.0, 0.8, 0.95])
def test_errors_of_corners_that_last_are_not_new_votes_in_each_view(lasting):
    """Squared distances by six, of the tags of some worlds; 5 and 11 if each view is a vote."""
    found = []
    for seed in range(runs(3, of=8)):
        random = np.random.default_rng(seed)
        tags, cameras = floor(random, 8, 4.0), flight(random, 80, 4.0)
        made = smooth(world(random, cameras, tags, 0.2, lasting=lasting))
        anchor = made.problem.anchor
        numbers = [int(name.split("_")[1]) for name in made.problem.names]
        for row, number in enumerate(numbers):
            true = inverse(tags[numbers[anchor]]) @ tags[number]
            off = made.tags.t[row] - true[:3, 3], turn_between(made.tags.R[row], true[:3, :3])
            error = np.concatenate(off)
            if row != anchor:
                found.append(error @ np.linalg.solve(made.covariances[row], error) / 6)
    assert 0.5 < np.mean(found) < 2

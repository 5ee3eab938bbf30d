"""Tags of another size than was given, that are alone in their images."""

import numpy as np
import pytest
from made_worlds import SIZE, drifting, flight, floor, world

from ros_visualise.estimation.mapping.mapping import map_of
from ros_visualise.estimation.mapping.outliers import other_size
from ros_visualise.estimation.mapping.sizes import larger
from ros_visualise.estimation.mapping.smoothing import smooth
from ros_visualise.estimation.mapping.unknowns import MeasurementNoise

NOISE = MeasurementNoise(extra_px=0.2, way_m=0.01)
COUNT = 4


def alone(by):
    """A flight over tags that lie far apart; the second one's size is wrong by a factor."""
    random = np.random.default_rng(4)
    tags, cameras = floor(random, COUNT, 24.0), flight(random, 80, 24.0)
    told = drifting(random, cameras, NOISE)
    size_of = lambda tag: SIZE * (by if tag == 1 else 1.0)  # noqa: E731
    problem = world(random, cameras, tags, 0.2, size_of, odometry=told)
    views = [one.view for one in problem.sightings]
    assert len(views) == len(set(views)), "two tags are in one image"
    return problem


def test_views_and_ways_tell_the_size_of_a_tag():
    part, sigma = larger(smooth(alone(1.1), NOISE))
    assert abs(part[1] - 0.1) < 4 * sigma[1]
    assert np.argmax(np.abs(part) / sigma) == 1


def test_a_tag_of_another_size_is_named_and_set_right():
    made = map_of(alone(0.75))
    [wrong] = [one for one in made.outliers if one.kind == "size"]
    assert wrong.name == "tag36h11_1"
    assert wrong.value == pytest.approx(0.75, rel=0.03)
    assert f"not {SIZE:.3f} m" in wrong.text
    assert "check" in wrong.text


def test_tags_of_the_size_that_was_given_are_not_blamed():
    problem = alone(1.0)
    assert not other_size(problem, smooth(problem, NOISE))

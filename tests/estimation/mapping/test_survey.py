"""What was surveyed, as a file tells it."""

import numpy as np
import pytest

from ros_visualise.core.errors import OpenError
from ros_visualise.estimation.mapping.problem import Problem
from ros_visualise.estimation.mapping.survey import read_survey

SURVEY = """\
landmarks:
- {name: tag36h11_3, position: [1, 2, 3], sigma: 0.02}
- {name: tag36h11_4, position: [1, 2, 4], sigma: [0.1, 0.2, 0.3], orientation: [0, 0, 0, 1]}
- {name: tag36h11_99, position: [0, 0, 0]}
distances:
- {between: [tag36h11_3, tag36h11_4], metres: 1.02, sigma: 0.005}
"""


@pytest.fixture
def survey(tmp_path):
    def survey(text):
        path = tmp_path / "survey.yaml"
        path.write_text(text)
        return read_survey(path)

    return survey


def test_places_and_distances_go_to_the_tags_that_were_seen(survey):
    problem = Problem(np.zeros(0, np.int64), ["tag36h11_3", "tag36h11_4"], [])
    problem, unseen = survey(SURVEY).added_to(problem)
    assert unseen == ["tag36h11_99"]
    third, fourth = problem.surveyed
    np.testing.assert_allclose(third.position_sigma, 0.02)
    assert third.R is None
    np.testing.assert_allclose(fourth.position_sigma, [0.1, 0.2, 0.3])
    np.testing.assert_allclose(fourth.R, np.eye(3))
    [known] = problem.distances
    assert (known.tags, known.distance_m, known.sigma_m) == ((0, 1), 1.02, 0.005)


def test_a_map_of_before_is_a_survey(survey):
    covariance = np.diag([1e-4, 4e-4, 9e-4, 1e-6, 1e-6, 1e-6]).ravel().tolist()
    pose = {"position": [5, 6, 7], "orientation": [0, 0, 0, 1], "covariance": covariance}
    [(name, known)] = survey(f"frame_id: map\nlandmarks:\n- {{name: a_1, pose: {pose}}}\n").tags
    assert name == "a_1"
    np.testing.assert_allclose(known.position_xyz, [5, 6, 7])
    np.testing.assert_allclose(known.position_sigma, [0.01, 0.02, 0.03])
    np.testing.assert_allclose(known.R_sigma, 1e-3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("- 1\n", "give a list of landmarks, a list of distances, or both"),
        ("landmarks: [{position: [1, 2, 3]}]\n", "landmarks, entry 1: tag name missing"),
        ("landmarks: [{name: a, position: [1, 2]}]\n", "entry 1: position: give 3 numbers"),
        ("landmarks: [{name: a, position: [1, 2, 3], sigma: -1}]\n", "must not be negative"),
        ("distances: [{between: [a, a], metres: 1}]\n", "give the names of two tags"),
        ("distances: [{between: [a, b], metres: 0}]\n", "must be positive"),
        ("landmarks: 3\n", "landmarks: give a list"),
    ],
)
def test_a_wrong_survey_is_told_where_and_why(survey, text, message):
    with pytest.raises(OpenError, match=message):
        survey(text)

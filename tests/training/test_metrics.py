"""Average precision and recall of detections whose truth is known."""

import numpy as np
import pytest
from evaluate import Result, least_score, report
from metrics import Found, average_precision, gather, match, recall_at

from ros_visualise.landmarks.networks.candidates import Candidates

TRUTH = np.array([[0, 0, 10, 10], [20, 0, 30, 10]], float)
COUNTED = np.array([False, False])


def found(*rows: tuple[float, ...]) -> Found:
    table = np.array(rows, float).reshape(-1, 5)
    return Found(table[:, :4], table[:, 4])


def test_a_thing_is_found_once():
    """The second detection of the same thing is wrong."""
    twice = found((0, 0, 10, 10, 0.9), (0, 0, 10, 9, 0.8), (20, 0, 30, 10, 0.7))
    assert match(twice, TRUTH, COUNTED) == [0, -1, 1]


def test_half_an_overlap_is_needed():
    close, far = (0, 0, 10, 5.1, 0.9), (0, 0, 10, 4.9, 0.9)
    assert match(found(close), TRUTH, COUNTED) == [0]
    assert match(found(far), TRUTH, COUNTED) == [-1]


def test_what_is_ignored_neither_helps_nor_hurts():
    both = found((0, 0, 10, 10, 0.9), (20, 0, 30, 10, 0.8))
    matches = gather([(both, TRUTH, np.array([True, False]))])
    assert matches.truths == 1
    assert matches.right.tolist() == [True]


def test_all_right_is_one_and_nothing_found_is_none():
    right = found((0, 0, 10, 10, 0.9), (20, 0, 30, 10, 0.8))
    assert average_precision(gather([(right, TRUTH, COUNTED)])) == pytest.approx(1)
    assert average_precision(gather([(found(), TRUTH, COUNTED)])) == 0
    assert np.isnan(average_precision(gather([(right, TRUTH[:0], COUNTED[:0])])))


def test_average_precision_by_hand():
    """Right, wrong, right: precision 1 up to recall 1/2, then 2/3."""
    rows = found((0, 0, 10, 10, 0.9), (50, 50, 60, 60, 0.8), (20, 0, 30, 10, 0.7))
    matches = gather([(rows, TRUTH, COUNTED)])
    assert average_precision(matches) == pytest.approx(0.5 * 1 + 0.5 * 2 / 3)
    assert recall_at(matches, 0.95) == (0.5, 0.9)
    assert recall_at(matches, 0.6) == (1.0, 0.7)


def test_pictures_count_together():
    first = (found((0, 0, 10, 10, 0.5)), TRUTH[:1], COUNTED[:1])
    second = (found((5, 50, 9, 60, 0.9)), TRUTH[:1], COUNTED[:1])
    matches = gather([first, second])
    assert matches.scores.tolist() == [0.9, 0.5]
    assert average_precision(matches) == pytest.approx(0.5 * 0.5)


@pytest.mark.parametrize("pictures", [50, 100, 300])
def test_the_least_score_lets_one_false_detection_in_100_pictures_through(pictures):
    scores = np.random.default_rng(pictures).uniform(0.3, 1, 40)
    least = least_score(scores, pictures)
    assert (scores >= least).sum() <= 0.01 * pictures
    assert (scores >= least - 0.0101).sum() > 0.01 * pictures


def test_without_false_detections_the_lowest_score_of_the_tables_will_do():
    assert least_score(np.zeros(0), 100) == 0.3


def test_objects_of_a_class_that_the_network_lacks_do_not_count(capsys):
    nothing = Candidates(np.zeros((0, 4)), np.zeros(0), np.zeros(0, int))
    row = [10.0, 10.0, 50.0, 50.0, 30.0, 40.0, 1.0]
    report({0: "helipad"}, [Result(np.array([[0.0, *row], [4.0, *row]]), nothing)], "Worlds")
    said = capsys.readouterr().out
    assert "that this network lacks do not count: [4]" in said
    assert next(line for line in said.splitlines() if "helipad" in line).startswith(
        "| helipad | 1 |"
    )

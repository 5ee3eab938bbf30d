"""Which of the candidates count: by score, number, class and overlap."""

import numpy as np
import pytest

from ros_visualise.landmarks.networks.candidates import Candidates, SelectionRules, choose

BOX = [10.0, 20, 30, 60]


def candidates(boxes, scores, classes=None, **more):
    classes = np.zeros(len(scores), int) if classes is None else np.array(classes)
    return Candidates(
        np.array(boxes, float).reshape(-1, 4), np.array(scores, float), classes, **more
    )


def moved(by):
    return [BOX[0] + by, BOX[1], BOX[2] + by, BOX[3]]


def test_of_two_that_overlap_the_better_one_counts():
    # moved by 5 of 20 the shared part is 15 of 25: 0.6
    found = candidates([moved(5), BOX, moved(100)], [0.6, 0.9, 0.5])
    assert choose(found, SelectionRules(max_overlap=0.59), True).scores.tolist() == [0.9, 0.5]
    assert choose(found, SelectionRules(max_overlap=0.61), True).scores.tolist() == [0.9, 0.6, 0.5]
    assert choose(found, SelectionRules(max_overlap=0.59), False).scores.tolist() == [0.9, 0.6, 0.5]


def test_things_of_two_classes_may_lie_on_one_another():
    found = candidates([BOX, BOX, BOX], [0.7, 0.9, 0.8], [1, 2, 1])
    chosen = choose(found, SelectionRules(), True)
    assert chosen.classes.tolist() == [2, 1]
    assert chosen.scores.tolist() == [0.9, 0.8]


def test_what_is_covered_by_what_is_covered_counts():
    found = candidates([BOX, moved(8), moved(16)], [0.9, 0.8, 0.7])
    assert choose(found, SelectionRules(max_overlap=0.4), True).scores.tolist() == [0.9, 0.7]


def test_suppression_is_that_of_its_definition():
    rng = np.random.default_rng(3)
    low = rng.uniform(0, 60, (300, 2))
    boxes = np.hstack([low, low + rng.uniform(5, 40, (300, 2))])
    scores, classes = rng.permutation(300) / 300, rng.integers(0, 3, 300)
    chosen = choose(candidates(boxes, scores, classes), SelectionRules(0.1, 0.3, 300), True)
    kept = []
    for one in np.argsort(-scores):
        if scores[one] < 0.1:
            continue
        for other in kept:
            low, high = np.maximum(boxes[one], boxes[other]), np.minimum(boxes[one], boxes[other])
            sides = np.maximum(high[2:] - low[:2], 0)
            areas = [np.prod(b[2:] - b[:2]) for b in (boxes[one], boxes[other])]
            union = sum(areas) - np.prod(sides)
            if classes[one] == classes[other] and np.prod(sides) / union > 0.3:
                break
        else:
            kept.append(one)
    assert chosen.scores == pytest.approx(scores[kept])
    assert chosen.boxes_xyxy == pytest.approx(boxes[kept])


@pytest.mark.parametrize(
    "box",
    [
        [np.nan, 20, 30, 60],
        [10, 20, np.inf, 60],
        [30, 20, 10, 60],
        [10, 20, 30, 20],
        [-1e30, -1e30, 1e30, 1e30],
    ],
)
def test_what_is_no_box_is_none(box):
    chosen = choose(candidates([box, BOX], [0.9, 0.8]), SelectionRules(), True)
    assert chosen.boxes_xyxy.tolist() == [BOX]


def test_nothing_else_is_lost_on_the_way():
    points, covariances = np.array([[1.0, 2], [3, 4], [5, 6]]), np.arange(12.0).reshape(3, 2, 2)
    found = candidates(
        [BOX, moved(50), moved(90)],
        [0.5, np.nan, 0.6],
        [4, 5, 6],
        points_uv=points,
        covariances=covariances,
    )
    chosen = choose(found, SelectionRules(), True)
    assert chosen.classes.tolist() == [6, 4]
    assert chosen.points_uv.tolist() == [[5, 6], [1, 2]]
    assert chosen.covariances.tolist() == covariances[[2, 0]].tolist()


def test_a_point_that_is_none_is_none():
    found = candidates(
        [moved(50 * number) for number in range(4)],
        [0.5, 0.6, 0.7, 0.8],
        points_uv=np.array([[1.0, np.nan], [3, 4], [5, 6], [1e20, 0]]),
        covariances=np.array([np.eye(2), np.full((2, 2), np.inf), np.eye(2), np.eye(2)]),
    )
    assert choose(found, SelectionRules(), True).scores.tolist() == [0.7]


def test_the_best_are_kept_and_those_of_wanted_classes():
    found = candidates([moved(50 * n) for n in range(6)], [0.3, 0.8, 0.5, 0.9, 0.4, 0.2], range(6))
    assert choose(found, SelectionRules(most=2), True).classes.tolist() == [3, 1]
    assert choose(found, SelectionRules(most=2), False).classes.tolist() == [3, 1]
    assert choose(found, SelectionRules(classes=frozenset({2, 4})), True).classes.tolist() == [2, 4]
    assert len(choose(found, SelectionRules(min_score=0.95), True)) == 0

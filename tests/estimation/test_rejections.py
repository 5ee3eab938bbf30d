"""What a person is told: once, and only where it stays so."""

from ros_visualise.estimation.landmark_map import ImageOutcome
from ros_visualise.estimation.rejections import Rejections


def refused():
    outcome = ImageOutcome()
    outcome.reject("tag36h11_3", "position disagrees with the map (22.7 sigma)", "has it moved?")
    return outcome


def test_a_tag_that_is_always_refused_is_named_once():
    doubts = Rejections()
    said = [text for _ in range(30) for text in doubts.look(refused())]
    assert said == ["ignoring tag36h11_3: position disagrees with the map; has it moved?"]


def test_one_that_is_refused_now_and_then_is_not_worth_a_word():
    doubts = Rejections()
    images = [*[refused()] * 4, ImageOutcome(used=["tag36h11_3"])] * 5
    assert not [text for outcome in images for text in doubts.look(outcome)]


def test_images_without_it_change_nothing():
    doubts = Rejections()
    assert [
        text for _ in range(9) for one in (refused(), ImageOutcome()) for text in doubts.look(one)
    ]

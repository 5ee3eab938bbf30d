"""In a video tags are looked for near their last places, and none is lost by that."""

import drawn_tags
import numpy as np

from ros_visualise.landmarks.tags import TagFinder, draw_cells, family
from ros_visualise.landmarks.tags.search import TagSearch

FAMILY = family("tag36h11")


class Counting(TagFinder):
    """Counts the looks at a whole image."""

    wholes = 0

    def find(self, gray, regions=(), info=None):
        self.wholes += not regions
        return super().find(gray, regions, info)


def film(count, places):
    """Images with tags at ``places(number)``: id -> (left, top)."""
    rng = np.random.default_rng(1)
    parts = [drawn_tags.side_to_side(*draw_cells(FAMILY, id), rng, 50)[0] for id in range(2)]
    for number in range(count):
        image = np.full((480, 640), 128, np.uint8)
        for id, (left, top) in places(number).items():
            image[top : top + len(parts[id]), left : left + len(parts[id])] = parts[id]
        yield image


def followed(images, every):
    finder, search = Counting([FAMILY]), TagSearch()
    return [search.find(finder, image, every) for image in images], finder.wholes


def test_moving_tags_are_followed_without_looking_at_the_whole():
    def places(n):
        return {0: (20 + 30 * n, 60), 1: (500 - 20 * n, 300)}

    images = list(film(13, places))
    near, wholes = followed(images, every=5)
    assert wholes == 3  # of the images 0, 5 and 10
    for image, tags in zip(images, near, strict=True):
        expected = TagFinder([FAMILY]).find(image)
        assert [tag.id for tag in tags] == [0, 1]
        for one, other in zip(tags, expected, strict=True):
            np.testing.assert_allclose(one.corners_uv, other.corners_uv, atol=0.15)


def test_a_new_tag_waits_for_the_next_look_at_everything():
    found, _ = followed(film(11, lambda n: {0: (20, 60)} | ({1: (400, 300)} if n else {})), 5)
    assert [len(tags) for tags in found] == [1] * 5 + [2] * 6


def test_a_tag_that_jumps_is_found_at_once():
    found, wholes = followed(film(5, lambda n: {0: (20, 60) if n < 2 else (450, 350)}), 100)
    assert [len(tags) for tags in found] == [1] * 5
    assert wholes == 2


def test_of_several_tags_of_one_number_none_is_lost():
    image = np.hstack(list(film(2, lambda n: {0: (100 + n, 100)})))
    found, wholes = followed([image] * 4, 10)
    assert [len(tags) for tags in found] == [2] * 4
    assert wholes == 1


def test_nothing_is_remembered_after_a_reset():
    finder, search = Counting([FAMILY]), TagSearch()
    (image,) = film(1, lambda n: {0: (20, 60)})
    search.find(finder, image, 10)
    search.reset()
    search.find(finder, image, 10)
    assert finder.wholes == 2

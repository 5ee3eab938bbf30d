"""Where windows go on a screen."""

import pytest

from ros_visualise.core.errors import UsageError
from ros_visualise.ui.screen import Box, parse_place, part_of

SCREEN = Box(0, 0, 1601, 901)


@pytest.mark.parametrize("of", range(1, 8))
def test_the_parts_of_a_screen_lie_in_it_and_apart(of):
    parts = [part_of(SCREEN, number, of) for number in range(1, of + 1)]
    for part in parts:
        assert part.width > 0
        assert part.height > 0
        assert part.x + part.width <= SCREEN.width
        assert part.y + part.height <= SCREEN.height
    for one in parts:
        for other in parts:
            apart_x = one.x + one.width <= other.x or other.x + other.width <= one.x
            apart_y = one.y + one.height <= other.y or other.y + other.height <= one.y
            assert one is other or apart_x or apart_y


def test_four_parts_are_the_corners_in_reading_order():
    corners = [part_of(Box(10, 20, 800, 600), number, 4)[:2] for number in (1, 2, 3, 4)]
    assert corners == [(10, 20), (410, 20), (10, 320), (410, 320)]


def test_a_place_is_written_as_a_fraction():
    assert parse_place("2/4") == (2, 4)
    assert parse_place("") == (1, 1)


@pytest.mark.parametrize("text", ["2", "0/4", "5/4", "a/b", "1/", "-1/2"])
def test_what_is_no_place_is_refused(text):
    with pytest.raises(UsageError, match="2/4"):
        parse_place(text)

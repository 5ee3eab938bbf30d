"""What counts as seen in the pictures that the network learns from and is measured on."""

import cv2
import numpy as np
import pytest

pytest.importorskip("mujoco")

from shots import Seen
from visibility import difference, judge
from worlds import CLASSES

_SIDE = 160
_RED = 220, 40, 30


def seen(name, box, point=None, sides=None, hull=None):
    box = np.array(box, float)
    middle = (box[:2] + box[2:]) / 2
    point = middle if point is None else np.array(point)
    sides = np.sort(box[2:] - box[:2])[::-1] if sides is None else np.array(sides)
    x0, y0, x1, y1 = box
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]] if hull is None else hull, float)
    return Seen(CLASSES.index(name), box, corners, point, sides, 1.0)


@pytest.fixture
def bare():
    return np.full((_SIDE, _SIDE, 3), 100, np.uint8)


def shown(*arguments):
    """The share that counts."""
    return max(judge(*arguments).share, 0.0)


def painted(bare, box, level):
    picture = bare.copy()
    x0, y0, x1, y1 = box
    picture[y0 : y1 + 1, x0 : x1 + 1] = level
    return picture


def lettered(bare, box):
    """A white square with a dark H."""
    picture = painted(bare, box, 230)
    x0, y0, x1, _ = box
    side = x1 - x0
    origin = (x0 + side // 4, y0 + 3 * side // 4)
    scale, thick = side / 44, max(1, side // 8)
    cv2.putText(picture, "H", origin, cv2.FONT_HERSHEY_SIMPLEX, scale, (20, 20, 20), thick)
    return picture


@pytest.mark.parametrize(("red", "share"), [(105, 0.0), (140, 1.0)])
def test_a_post_counts_where_it_changes_the_picture(bare, red, share):
    box = 60, 40, 70, 90
    picture = painted(bare, box, (red, 80, 90))
    bare[40:91, 60:71] = 100, 80, 90
    assert shown(seen("post", box), picture, bare) == share


@pytest.mark.parametrize("light", [0.05, 1.0])
def test_a_post_counts_where_its_colour_can_be_seen(bare, light):
    box, bare = (60, 40, 70, 90), (bare * light).astype(np.uint8)
    red = painted(bare, box, np.array((240, 60, 60)) * light + 20)
    assert shown(seen("post", box), red, bare) == (light == 1)
    banded = red.copy()
    banded[60:75, 60:71] = 250
    assert shown(seen("post", box), banded, bare) == (light == 1)
    assert shown(seen("post", box), painted(bare, box, 240), bare) == 0


def test_texture_around_it_makes_nothing_visible(bare):
    bare = np.random.default_rng(1).integers(0, 255, bare.shape, np.uint8)
    assert shown(seen("post", (60, 40, 70, 90)), bare.copy(), bare) == 0


def test_a_difference_in_colour_alone_counts(bare):
    box = 60, 40, 100, 90
    assert difference(np.array(box, float), painted(bare, box, (140, 80, 100)), bare) > 20


@pytest.mark.parametrize("name", ["helipad", "tag"])
def test_a_print_counts_where_its_pattern_can_be_seen(bare, name):
    box = 40, 40, 100, 100
    assert shown(seen(name, box), lettered(bare, box), bare) == 1
    assert shown(seen(name, box), painted(bare, box, 230), bare) == 0


def test_what_is_beside_a_triangle_is_not_its_pattern(bare):
    """The middle of its box has some ground in it, the middle of its outline has none."""
    triangle = np.array([[70, 40], [100, 100], [40, 100]])
    pad = seen("helipad", (40, 40, 100, 100), point=(70.0, 80.0), hull=triangle)
    picture = cv2.fillConvexPoly(bare.copy(), triangle, (230, 230, 230))
    assert shown(pad, picture, bare) == 0
    cv2.putText(picture, "H", (62, 90), cv2.FONT_HERSHEY_SIMPLEX, 0.8, (20, 20, 20), 2)
    assert shown(pad, picture, bare) == 1


def test_a_pad_needs_its_letter(bare):
    small, large = (40, 40, 56, 56), (40, 40, 100, 100)
    assert shown(seen("helipad", small), lettered(bare, small), bare) == 0
    beyond = seen("helipad", large, point=(-3.0, 70.0))
    assert shown(beyond, lettered(bare, large), bare) == 0


def test_a_tag_needs_cells_of_a_pixel(bare):
    box = 40, 40, 60, 60
    picture = lettered(bare, box)
    assert shown(seen("tag", box, sides=(20.0, 12.0)), picture, bare) == 1
    assert shown(seen("tag", box, sides=(20.0, 8.0)), picture, bare) == 0


@pytest.mark.parametrize(
    ("sides", "share"), [((50.0, 10.0), 1.0), ((50.0, 1.5), 0.0), ((12.0, 10.0), 0.0)]
)
def test_a_post_is_neither_a_scratch_nor_a_disc(bare, sides, share):
    box = 60, 40, 70, 90
    picture = painted(bare, box, _RED)
    assert shown(seen("post", box, sides=sides), picture, bare) == share


def test_a_post_needs_its_foot(bare):
    box = 60, 120, 70, 159
    picture = painted(bare, box, _RED)
    assert shown(seen("post", box, point=(65.0, 158.0)), picture, bare) == 1
    assert shown(seen("post", box, point=(65.0, 170.0)), picture, bare) == 0


def test_prints_from_the_side_do_not_count(bare):
    box = 20, 60, 140, 75
    picture = painted(bare, box, 230)
    picture[60:76, 50:110:10] = 20
    assert shown(seen("tag", box), picture, bare) == 0
    assert shown(seen("vehicle", box), picture, bare) == 1
    aslant = seen("tag", (20, 60, 80, 120), sides=(85.0, 12.0))
    assert shown(aslant, lettered(bare, (20, 60, 80, 120)), bare) == 0

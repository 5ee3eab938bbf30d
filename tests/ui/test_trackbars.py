"""How values lie on trackbars, and windows on a screen: no screen is needed."""

from dataclasses import dataclass
from enum import Enum
from itertools import combinations

import pytest

from ros_visualise.core.params import param
from ros_visualise.ui.screen import TITLE, Box, tile
from ros_visualise.ui.trackbars import scales_of


class Mode(Enum):
    OFF = "off"
    ON = "on"
    AUTO = "auto"


@dataclass(frozen=True)
class Params:
    level: int = param(3, "an int below zero too", min=-5, max=5)
    factor: float = param(1.0, "a float", min=0.1, max=2.05)
    shown: int = param(30, "a slider smaller than its limits", min=0, max=240, slider=(0, 30))
    switch: bool = param(True, "a bool")
    mode: Mode = param(Mode.ON, "a choice")
    text: str = param("", "no trackbar: a text")
    endless: float = param(1.0, "no trackbar: without limits", min=0)
    size: int = param(1, "no trackbar: reopens the source", min=1, max=9, restart=True)


SCALES = {scale.spec.name: scale for scale in scales_of(Params)}


def test_what_a_trackbar_cannot_set_has_none():
    assert list(SCALES) == ["level", "factor", "shown", "switch", "mode"]


@pytest.mark.parametrize("name", SCALES)
def test_every_position_is_a_value_of_its_own_and_back(name):
    scale = SCALES[name]
    values = [scale.value(position) for position in range(scale.last + 1)]
    assert [scale.position(value) for value in values] == list(range(scale.last + 1))
    assert all(type(value) is scale.spec.type for value in values)


def test_ends_of_the_trackbars_are_the_ends_of_the_ranges():
    ends = {name: (s.value(0), s.value(s.last)) for name, s in SCALES.items()}
    assert ends == {
        "level": (-5, 5),
        "factor": (0.1, 2.05),
        "shown": (0, 30),
        "switch": (False, True),
        "mode": (Mode.OFF, Mode.AUTO),
    }
    assert 100 <= SCALES["factor"].last <= 250
    assert SCALES["factor"].value(3) == 0.13


def test_a_value_beyond_the_slider_lies_at_its_end():
    assert SCALES["shown"].position(100) == 30


@pytest.mark.parametrize("extras", [[0], [0, 50], [0, 50, 0, 225], [25] * 5, [0] * 9])
def test_windows_lie_on_the_screen_and_none_covers_another(extras):
    area = Box(0, 0, 1500, 1080)
    boxes = tile(area, extras)
    assert len(boxes) == len(extras)
    for box in boxes:
        assert box.x >= 0
        assert box.x + box.width <= area.width
        assert box.y >= 0
        assert box.y + box.height + TITLE <= area.height
    for a, b in combinations(boxes, 2):
        apart_x = a.x + a.width <= b.x or b.x + b.width <= a.x
        apart_y = a.y + a.height + TITLE <= b.y or b.y + b.height + TITLE <= a.y
        assert apart_x or apart_y
    assert len({box.height - extra for box, extra in zip(boxes, extras, strict=True)}) == 1

"""Curves drawn with letters."""

import numpy as np

from ros_visualise.plotting.text_plot import draw_text


def test_a_square_is_drawn_as_one():
    square = np.array([[0, 0], [9, 0], [9, 9], [0, 9], [0, 0]], float)
    lines = draw_text([("*", square)], "x (m)", "y (m)", columns=24, rows=40)
    inside = [line[1:-1] for line in lines if line.startswith("|")]
    assert (len(inside[0]), len(inside)) == (22, 11)  # letters are twice as high as wide
    assert inside[0] == inside[-1] == "*" * 22
    assert all(row == f"*{' ' * 20}*" for row in inside[1:-1])
    assert lines[-2:] == ["x (m): 0 to 9", "y (m): 0 to 9"]


def test_what_goes_up_is_drawn_upwards_and_the_last_lies_on_top():
    up = np.array([[0, 0], [10, 10]], float)
    lines = draw_text([(".", up), ("o", up[1:])], "x", "y", columns=24, rows=20)
    inside = [line[1:-1] for line in lines if line.startswith("|")]
    assert inside[-1][0] == "."
    assert inside[0][-1] == "o"


def test_it_keeps_to_its_room_whatever_the_shape():
    rng = np.random.default_rng(0)
    for scale in ([1, 1], [1e6, 1], [1, 1e-9], [0, 0], [0, 3]):
        curve = rng.normal(size=(200, 2)) * scale
        lines = draw_text([("*", curve)], "x", "y", columns=60, rows=20)
        assert len(lines) <= 20
        assert max(map(len, lines[:-2])) <= 60
        assert any("*" in line for line in lines)

"""Nodes with nothing but a button have no window: it is in the main panel."""

from pathlib import Path

from ros_visualise.graph import Node, place
from ros_visualise.lessons import LESSONS
from ros_visualise.lessons.handout import handout_of
from ros_visualise.nodes import find_node
from ros_visualise.ui.page.tools import is_tool
from ros_visualise.ui.page.windows import has_window


def _placed(declared) -> Node:
    inputs = {port: f"/{port}" for port in declared.inputs}
    return place(declared, inputs, {port: f"/out/{port}" for port in declared.outputs})


def test_the_handout_of_a_lesson_takes_no_window():
    handout = _placed(handout_of(LESSONS.find("canny"), {"edges": ""}, Path(), False).declared)
    assert is_tool(handout)
    assert not has_window(handout)


def test_a_node_with_images_or_parameters_keeps_its_window():
    for name in ("filters", "path", "calibrator"):
        assert not is_tool(_placed(find_node(name)))
        assert has_window(_placed(find_node(name)))

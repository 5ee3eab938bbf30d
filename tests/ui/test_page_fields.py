"""The picture of the tree of frames, and what is said of frames."""

import xml.etree.ElementTree as ET

import numpy as np
from scene_messages import S

from ros_visualise.ui.page.tree import tree_picture
from ros_visualise.ui.scene.controls import notes
from ros_visualise.ui.scene.frames import Link

TREE = [
    Link("odom", "base_link", False, 5 * S, 50.0),
    Link("base_link", "camera", True, 0, None),
    Link("base_link", "<laser>", True, 0, None),
    Link("map", "odom", False, 2 * S, 10.0),
]


def texts_of(links):
    return {text.text: text for text in ET.fromstring(tree_picture(links)).iter("text")}


def test_the_tree_shows_frames_below_their_parents_and_what_is_known_of_each():
    texts = texts_of(TREE)
    x, y = ({n: float(t.get(key)) for n, t in texts.items()} for key in "xy")
    assert y["map"] < y["odom"] < y["base_link"] < y["camera"] < y["<laser>"]
    assert x["map"] < x["odom"] < x["base_link"] < x["camera"] == x["<laser>"]
    assert {"50.0 Hz", "10.0 Hz, 3.0 s ago", "static"} <= set(texts)


def test_a_picture_of_many_frames_is_no_wider_than_of_few():
    many = [Link("base", f"wheel_{number:02}", True, 0, None) for number in range(40)]
    pictures = [ET.fromstring(tree_picture(links)) for links in (many[:1], many)]
    (few_width, few_height), (width, height) = (
        map(float, picture.get("viewBox").split()[2:]) for picture in pictures
    )
    assert width == few_width
    assert height > 20 * few_height / 2
    rows = [float(text.get("y")) for text in pictures[1].iter("text") if text.text != "static"]
    assert min(np.diff(sorted(rows))) > 11


def test_a_small_tree_is_not_enlarged():
    picture = ET.fromstring(tree_picture([Link("map", "odom", True, 0, None)]))
    width = float(picture.get("viewBox").split()[2])
    assert f"max-width:{width:.0f}px" in picture.get("style")


def test_several_trees_and_none_are_pictured():
    texts = texts_of([Link("a", "b", True, 0, None), Link("c", "d", True, 0, None)])
    assert {"a", "b", "c", "d"} <= set(texts)
    assert "No transforms" in tree_picture([])


def test_frames_that_go_round_are_pictured():
    assert {"a", "b"} <= set(
        texts_of([Link("a", "b", True, 0, None), Link("b", "a", True, 0, None)])
    )


def test_without_transforms_it_is_said_what_is_drawn_and_what_is_not():
    frames = {"/scan": "laser", "/fix": "", "/odom": "<odom>"}
    problems = {"/odom": "no transform from <odom> to laser", "/scan": "of no size"}
    first, second = notes("laser", frames, problems, has_transforms=False)
    assert first == (
        "No transforms received. Shown in frame laser: /scan, /fix."
        " Not shown (no transform to their frames): /odom (<odom>)"
    )
    assert second == "/scan: of no size"
    assert notes("laser", {"/scan": "laser"}, {}, False) == [
        "No transforms received. Shown in frame laser: /scan"
    ]


def test_with_transforms_it_is_said_what_has_none():
    problems = {"/odom": "no transform"}
    assert notes("map", {"/odom": "odom"}, problems, True) == [
        "Shown in map",
        "/odom: no transform",
    ]
    assert notes("", {}, {}, False) == []

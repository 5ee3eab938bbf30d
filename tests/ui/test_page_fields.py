"""What is plotted of messages, the picture of the tree of frames, and what is said of both."""

import xml.etree.ElementTree as ET

import numpy as np
from scene_messages import S, odometry

from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import Recorded
from ros_visualise.ui.page.plots import FieldHistory, fields_of
from ros_visualise.ui.page.scene_panel import note
from ros_visualise.ui.page.tree import tree_picture
from ros_visualise.ui.scene.frames import Link


def test_fields_are_called_as_in_the_ros_type():
    fields = fields_of(odometry([1, 2, 3], 1.5))
    assert fields["pose.pose.position.y"] == 2
    assert fields["header.stamp"] == 1.5


def test_messages_of_types_that_nobody_knows_have_fields():
    definitions = Definitions("cdr")
    definitions.define("my_msgs/msg/Battery", "float32 voltage\nuint8[3] cells\nstring name\n")
    battery = definitions.types["my_msgs/msg/Battery"](12.5, np.array([1, 2, 3], np.uint8), "a")
    data = definitions.write("my_msgs/msg/Battery", battery)
    fields = fields_of(Recorded("my_msgs/msg/Battery", data, definitions, 7))
    assert fields == {"voltage": 12.5, "cells[0]": 1, "cells[1]": 2, "cells[2]": 3}


def test_a_history_holds_the_last_seconds():
    history = FieldHistory(["a"])
    for step in range(100):
        history.add(10**18 + step * S, {"a": step, "b": 0}, 0)
    seconds, values = history.columns(10)
    assert seconds.tolist() == list(range(89, 100))
    assert values.tolist() == seconds.tolist()


def test_a_history_is_bounded_and_thinned():
    history = FieldHistory(["a"])
    for step in range(30_000):
        history.add(step * S // 1000, {"a": step}, 0)
    seconds, values = history.columns(1000)
    assert 750 <= len(seconds) <= 1500
    assert values[0] == 10_000


def test_a_history_begins_anew_when_time_jumps_back_and_has_gaps_where_a_field_lacks():
    history = FieldHistory(["a"])
    history.add(5 * S, {"a": 1}, 0)
    history.add(6 * S, {"a": 2}, 0)
    history.add(5 * S, {"a": 7}, 0)
    history.add(3 * S, {"a": 3}, 1)
    history.add(4 * S, {}, 1)
    seconds, values = history.columns(10)
    assert seconds.tolist() == [0, 1]
    assert values[0] == 3
    assert np.isnan(values[1])


def test_nothing_has_no_history():
    assert [len(column) for column in FieldHistory(["a", "b"]).columns(10)] == [0, 0, 0]


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
    first, second = note("laser", frames, problems, has_transforms=False)
    assert first == (
        "No transforms. Shown in <b>laser</b>: /scan, /fix."
        " Not shown (no transform to their frames): /odom (&lt;odom&gt;)"
    )
    assert second == "/scan: of no size"
    assert note("laser", {"/scan": "laser"}, {}, False) == [
        "No transforms. Shown in <b>laser</b>: /scan"
    ]


def test_with_transforms_it_is_said_what_has_none():
    problems = {"/odom": "no transform"}
    assert note("map", {"/odom": "odom"}, problems, True) == [
        "Shown in <b>map</b>",
        "/odom: no transform",
    ]
    assert note("", {}, {}, False) == []

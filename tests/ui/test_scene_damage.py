"""The scene when messages hold what nobody expects: it goes on, and says which topic it is."""

import numpy as np
import pytest
from scene_messages import LEVEL, S, cloud, draw, has, is_at, odometry, tf, transform

from ros_visualise.data import Header, LaserScan, Odometry
from ros_visualise.ui.scene.kinds import DRAWINGS

LINE = np.stack([np.arange(11.0), np.zeros(11), np.zeros(11)], axis=1)


def scan(ranges=(1.0, 2.0), start=0.0):
    return LaserScan(ranges, start, np.pi, np.pi / 2, 0.1, 10.0, header=Header(S, "map"))


def test_a_scan_with_an_angle_that_is_no_number_does_not_stop_the_others(scene, look, caplog):
    for _ in range(3):
        draw(scene, scan=scan(start=np.nan), points=cloud(LINE, "map"))
    look("topics/points/points", has("points", 11))
    assert "angles" in scene.problems["/scan"]
    assert caplog.text.count("/scan") == 1
    draw(scene, scan=scan())
    look("topics/scan/points", has("points", 2))
    assert scene.problems == {}


def test_a_drawing_that_fails_does_not_stop_the_others(scene, look, caplog, monkeypatch):
    def fail(*_):
        raise IndexError("nobody thought of that")

    monkeypatch.setattr(DRAWINGS[LaserScan], "draw", fail)
    draw(scene, a=scan(), points=cloud(LINE, "map"))
    look("topics/points/points", has("points", 11))
    assert "nobody thought of that" in scene.problems["/a"]
    assert "/a not drawn" in caplog.text


@pytest.mark.parametrize("place", [[np.nan, 0, 0], [np.inf, 0, 0], [0, 1e30, 0]], ids=str)
def test_a_place_that_is_none_does_not_move_the_cameras(scene, look, clock, place):
    draw(scene, odom=odometry([1, 0, 0], 1), points=cloud(LINE, "odom"))
    before = np.array(scene.view.home)
    draw(scene, odom=odometry(place, 2))
    clock.now_s = 10.0
    draw(scene, points=cloud([*LINE, [3e37, 0, 0]], "odom"))
    scene.reset_view()
    assert np.abs(np.array(scene.view.home) - before).max() < 100
    assert np.abs(look.update()["/view"]["robot"]).max() < 100
    draw(scene, odom=odometry([3, 0, 0], 3))
    look("topics/odom/axes", is_at([3, 0, 0]))


@pytest.mark.parametrize("ranges", [(), (np.inf, np.inf)], ids=["none", "nothing there"])
def test_a_scan_without_points_removes_those_before(scene, look, ranges):
    draw(scene, empty=scan(ranges), scan=scan())
    look("topics/scan/points", has("points", 2))
    assert len(look("topics/empty/points")["points"]) == 0
    draw(scene, scan=scan(ranges))
    look("topics/scan/points", has("points", 0))
    draw(scene, scan=scan((3.0,)))
    look("topics/scan/points", has("points", 1))


def test_a_pose_that_is_no_number_is_said(scene, look):
    draw(scene, odom=odometry([np.nan, 0, 0]), tf=tf(transform("map", "odom", [1, 0, 0], 1)))
    assert "not a number" in scene.problems["/odom"]
    turned = Odometry(np.zeros(3), LEVEL * np.nan, header=Header(S, "odom"))
    draw(scene, odom=turned)
    assert "not a rotation" in scene.problems["/odom"]


def test_odd_transforms_are_said_once_with_their_topic(scene, caplog):
    odd = [
        transform("a", "b", [1, 0, 0], 1),
        transform("b", "c", [1, 0, 0], 1),
        transform("c", "a", [1, 0, 0], 1),
        transform("self", "/self", [1, 0, 0], 1),
        transform("", "nameless", [1, 0, 0], 1),
        transform("map", "flat", [1, 0, 0], 1, LEVEL * 0),
        transform("map", "nowhere", [np.nan, 0, 0], 1),
        transform("map", "box", [1, 0, 0], 1),
        transform("odom", "box", [1, 0, 0], 2),
    ]
    for _ in range(3):
        scene.show("/tf", tf(*odd))
    assert caplog.messages == [
        "/tf: 'c' -> 'a' would close a loop of frames (further occurrences suppressed)",
        "/tf: 'self' -> '/self' is its own parent (further occurrences suppressed)",
        "/tf: '' -> 'nameless' lacks a frame name (further occurrences suppressed)",
        "/tf: 'map' -> 'flat' has a quaternion of zeros (further occurrences suppressed)",
        "/tf: 'map' -> 'nowhere' holds a value that is not a number"
        " (further occurrences suppressed)",
        "/tf: 'box' has several parents: map and odom (further occurrences suppressed)",
    ]


def test_transforms_as_they_should_be_say_nothing(scene, caplog):
    for step in range(3):
        scene.show("/tf_static", tf(transform("base", "camera", [1, 0, 0])))
        scene.show("/tf", tf(transform("/odom", "base", [step, 0, 0], step)))
        scene.show("/tf", tf(transform("odom", "base", [0, 0, 0], 0)))  # and time jumps back
    assert caplog.messages == []

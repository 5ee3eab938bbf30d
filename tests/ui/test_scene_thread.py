"""The thread that draws the scene, and jumps in time."""

from types import SimpleNamespace

import pytest
from scene_messages import cloud, is_at, odometry, tf, transform
from scene_runtime import Told

from ros_visualise.data import Odometry, PointCloud, Transforms
from ros_visualise.ui.scene.thread import SceneThread


@pytest.fixture
def runtime():
    told = Told(odom=Odometry, points=PointCloud, tf=Transforms)
    told.playback = SimpleNamespace(laps=0)
    return told


@pytest.fixture
def drawing(runtime, scene):
    thread = SceneThread(runtime, scene, lambda: True, lambda: False)
    thread.follow(runtime.graph)
    thread.start()
    yield thread
    thread.close(5.0)


def test_a_trail_begins_anew_after_a_jump_though_time_goes_on(drawing, runtime, look):
    runtime.say(odom=odometry([1, 0, 0], 1))
    look("topics/odom/axes", is_at([1, 0, 0]))
    runtime.say(odom=odometry([2, 0, 0], 2))
    look("topics/odom/trail", lambda node: node["points"].max(initial=0) == 2)
    runtime.epoch += 1
    runtime.say(odom=odometry([5, 0, 0], 3))
    points = look("topics/odom/trail", lambda node: node["points"].max(initial=0) == 5)["points"]
    assert set(points[:, :, 0].flat) == {5.0}


def test_what_does_not_come_again_after_a_jump_is_not_to_be_seen(drawing, runtime, look):
    runtime.say(tf=tf(transform("odom", "lidar", [0, 0, 1], 1)))
    runtime.say(odom=odometry([0, 0, 0], 1), points=cloud([[1, 2, 3]]))
    look("topics/points", lambda node: node.get("visible"))
    runtime.epoch += 1
    runtime.say(tf=tf(transform("odom", "lidar", [0, 0, 1], 3)))
    runtime.say(odom=odometry([5, 0, 0], 3))
    look("topics/points", lambda node: node.get("visible") is False)
    look("topics/odom", lambda node: node["visible"])
    runtime.say(points=cloud([[1, 2, 3]], "odom", 3.0))
    look("topics/points", lambda node: node["visible"])

"""The page of a robot: the scene, its controls, plots of fields, and points over images."""

import numpy as np
import pytest
from page_client import Client, ImageClient, picture
from scene_messages import cloud, image, odometry, tf, transform
from scene_runtime import Told
from waiting import wait_for

from ros_visualise.data import Image, Odometry, PointCloud, Transforms
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.page import Page

DEPTH = np.stack([np.zeros(9), np.zeros(9), np.full(9, 5.0)], axis=1)
ROBOT = {"tf": Transforms, "tf_static": Transforms, "points": PointCloud, "odom": Odometry}


@pytest.fixture
def runtime():
    return Told(**ROBOT, image=Image)


@pytest.fixture
def page(runtime, port):
    page = Page(ViewOptions(port=port))
    page.open(runtime)
    yield page
    page.close()


@pytest.fixture
def client(page, port):
    client = Client(port)
    yield client
    client.close()


def test_what_is_published_is_drawn(client, runtime):
    runtime.say(tf_static=tf(transform("base_link", "lidar", [0, 0, 1])))
    runtime.say(tf=tf(transform("odom", "base_link", [3, 0, 0], 1)))
    runtime.say(points=cloud(DEPTH), odom=odometry([3, 0, 0]))
    drawn = client.nodes
    client.read_until(
        lambda: len(drawn.get("/world/topics/points/points", {}).get("points", ())) == 27
    )
    assert np.allclose(drawn["/world/topics/points"]["position"], [3, 0, 1])
    client.read_until(lambda: "/world/topics/odom/axes" in drawn)


def test_nothing_but_transforms_is_asked_for_while_nobody_looks(page, runtime, port):
    wait_for(lambda: runtime.asked["/tf"] >= 1)
    taken = runtime.asked["/tf"]
    runtime.say(tf_static=tf(transform("map", "lidar", [1, 0, 0])))
    runtime.say(tf_static=tf(transform("map", "odom", [2, 0, 0])), points=cloud(DEPTH))
    scene = page._content._scene
    wait_for(lambda: scene.frames.names == ["lidar", "map", "odom"])
    assert [runtime.asked[topic] for topic in ("/points", "/odom", "/image")] == [0, 0, 0]
    client = Client(port)
    wait_for(lambda: runtime.asked["/points"] == 1)
    client.read_until(lambda: "/world/topics/points/points" in client.nodes)
    client.close()
    wait_for(lambda: sum(runtime.asked[t] for t in ("/points", "/odom", "/image")) == 0)
    assert runtime.asked["/tf"] == taken


def test_a_hidden_topic_is_not_asked_for(client, runtime):
    client.read_until(lambda: runtime.asked["/points"] == 1)
    client.set("/points", False)
    client.read_until(lambda: runtime.asked["/points"] == 0)
    client.set("/points", True)
    client.read_until(lambda: runtime.asked["/points"] == 1)


def test_the_controls_reach_the_scene(client, runtime, page):
    scene = page._content._scene
    runtime.say(tf=tf(transform("map", "odom", [1, 0, 0], 1)))
    client.read_until(lambda: any("Shown in <b>map</b>" in text for text in client.html))
    client.set("Fixed frame", "odom")
    client.set("Point size", 0.3)
    client.set("Follow robot", False)
    client.set("Colour by", "Height")
    client.read_until(lambda: scene.frames.fixed == "odom" and scene.appearance.point_size == 0.3)
    client.read_until(lambda: not scene.view.follows)
    client.set("Fixed frame", "Auto")
    client.read_until(lambda: scene.frames.fixed == "map")


def test_what_has_no_transform_is_told(client, runtime):
    runtime.say(tf=tf(transform("map", "odom", [1, 0, 0], 1)), points=cloud(DEPTH, "<b>"))
    client.read_until(
        lambda: any("/points: " in text and "&lt;b&gt;" in text for text in client.html)
    )


def test_the_tree_of_frames_is_pictured(client, runtime, port):
    runtime.say(
        tf=tf(transform("map", "odom", [1, 0, 0], 1), transform("odom", "base_link", [0, 0, 0], 1))
    )
    wait_for(lambda: ">base_link<" in picture(port, "frames"))


def test_points_are_drawn_over_images_on_demand(client, runtime, port):
    runtime.say(tf_static=tf(transform("base_link", "lidar", [0, 0, 0])))
    runtime.say(tf_static=tf(transform("base_link", "camera", [0, 0, 0])))
    runtime.say(points=cloud(DEPTH), image=image())
    client.read_until(lambda: runtime.asked["/points"] == 1)
    looking = ImageClient(port)
    looking.show("/image", cloud="/points")
    looking.read_until(lambda: looking.images)
    assert looking.offers[0]["clouds"] == ["/points"]
    assert runtime.asked["/points"] == 2
    looking.show("/image")
    client.read_until(lambda: runtime.asked["/points"] == 1)
    looking.socket.close()


def test_images_alone_fill_the_page(port):
    page = Page(ViewOptions(port=port))
    page.open(Told(image=Image))
    client = Client(port)
    client.read_until(lambda: any("100% + 116px" in text for text in client.html))
    assert not any("68dvh" in text for text in client.html)
    client.close()
    page.close()


def test_a_scene_keeps_its_room_beside_the_images(client):
    client.read_until(lambda: any("68dvh" in text for text in client.html))

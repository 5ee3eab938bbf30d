"""The page of a robot: its frames, and points over images."""

import numpy as np
import pytest
from page_client import Client, ImageClient, picture
from scene_messages import cloud, image, tf, transform
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


def test_the_tree_of_frames_is_pictured(client, runtime, port):
    runtime.say(
        tf=tf(transform("map", "odom", [1, 0, 0], 1), transform("odom", "base_link", [0, 0, 0], 1))
    )
    wait_for(lambda: ">base_link<" in picture(port, "frames"))


def test_points_are_drawn_over_images_on_demand(client, runtime, port):
    runtime.say(tf_static=tf(transform("base_link", "lidar", [0, 0, 0])))
    runtime.say(tf_static=tf(transform("base_link", "camera", [0, 0, 0])))
    runtime.say(points=cloud(DEPTH), image=image())
    looking = ImageClient(port)
    looking.show("/image", cloud="/points")
    looking.read_until(lambda: looking.images)
    assert looking.offers[0]["clouds"] == ["/points"]
    assert runtime.asked["/points"] == 1
    looking.show("/image")
    client.read_until(lambda: runtime.asked["/points"] == 0)
    looking.socket.close()

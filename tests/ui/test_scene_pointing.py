"""The view after a time jump, the sizes of things, and clicks into the scene."""

import numpy as np
import pytest
from page_client import Client
from scene_messages import LEFT, cloud, draw, has, is_at, odometry, tf, transform
from scene_runtime import Told

from ros_visualise.data import Header, NavSatFix, Odometry, PointCloud, PoseStamped, Transforms
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.page import Page
from ros_visualise.ui.page.pointing import describe
from ros_visualise.ui.scene.picking import Ray, pick

S = 10**9
DOWN = Ray(np.array([0.0, 0, 10]), np.array([0.0, 0, -2]))
NOTHING = np.zeros((0, 3))


def test_after_a_jump_the_robot_is_where_it_was_in_the_view(scene, look):
    draw(scene, tf=tf(transform("odom", "base_link", [3, 0, 0], 1)))
    draw(scene, tf=tf(transform("odom", "base_link", [50, 8, 0], 9)))
    look("", is_at([-47, -8, 0]))
    scene.forget()
    scene.refresh()
    draw(scene, tf=tf(transform("odom", "base_link", [1, 2, 0], 0.5)))
    look("", is_at([2, -2, 0]))


def test_a_jump_changes_no_frame_in_which_all_is_drawn(scene, clock):
    draw(scene, tf_static=tf(transform("base_link", "lidar", [0, 0, 1])))
    draw(scene, tf=tf(transform("odom", "base_link", [3, 0, 0], 1)))
    scene.forget()
    assert scene.frames.fixed == "odom"
    clock.now_s = 3.0
    scene.refresh()
    assert scene.frames.fixed == "base_link"  # it does not come again


def test_a_track_of_fixes_is_seen_along_its_way(scene, server, clock):
    for second in range(4):
        clock.now_s = second
        place = NavSatFix(48.0 + second * 1e-4, 11.0, 500.0, header=Header(second * S, "gps"))
        scene.show("/fix", place)
        draw(scene)
    camera = server.initial_camera
    view = np.subtract(camera.look_at, camera.position)[:2]
    assert view[1] < 0, "it went north: all of its way lies south of it"
    assert abs(view[0]) < 0.1 * abs(view[1])


def test_what_comes_a_little_later_and_is_larger_is_looked_at_too(scene, server, clock):
    points = 20 * np.stack([np.cos(np.arange(64)), np.sin(np.arange(64)), np.zeros(64)], axis=1)
    draw(scene, odom=odometry([0, 0, 0], 1))
    near = server.initial_camera.position[2]
    clock.now_s = 0.5
    draw(scene, points=cloud(points, "odom"))
    far = server.initial_camera.position[2]
    assert far > 2 * near
    scene.forget()
    clock.now_s = 2.0
    draw(scene, odom=odometry([0, 0, 0], 2))
    assert server.initial_camera.position[2] == far, "the view does not fall back"


def test_frames_alone_are_looked_at_and_followed(scene, server, look):
    draw(scene, tf=tf(transform("start", "kinect", [200, 0, 0], 1, LEFT)))
    assert np.allclose(server.initial_camera.look_at[0], 200, atol=3)
    draw(scene, tf=tf(transform("start", "kinect", [203, 0, 0], 2, LEFT)))
    look("", is_at([-3, 0, 0]))


@pytest.mark.parametrize(("reach_m", "size"), [(0.12, 0.2), (0.7, 0.7), (40.0, 1.5)])
def test_axes_are_sized_by_the_robot(scene, look, reach_m, size):
    parts = [transform("base_link", name, [0, 0, z]) for name, z in (("a", reach_m), ("b", 0.1))]
    draw(scene, tf_static=tf(*parts), tf=tf(transform("odom", "base_link", [1, 0, 0], 1)))
    node = look("axes", has("batched_scales", 4))
    assert np.allclose(node["batched_scales"], size)


def test_fixes_are_not_drawn_at_first_where_others_tell_better(scene):
    scene.follow({"/fix": NavSatFix, "/odom": Odometry})
    assert not scene.is_visible("/fix")
    scene.follow({"/other": NavSatFix, "/points": PointCloud})
    assert scene.is_visible("/other")


def test_a_ray_meets_the_ground_or_what_stands_before_it():
    assert np.allclose(pick(DOWN, NOTHING), [0, 0, 0])
    assert np.allclose(pick(DOWN, NOTHING, ground_m=-5), [0, 0, -5])
    points = np.array([[0.02, 0, 4], [0.0, 0, 2], [3, 0, 5], [0, 0, 12.0]])
    assert np.allclose(pick(DOWN, points), [0.02, 0, 4])


def test_a_ray_into_the_sky_meets_nothing():
    assert pick(Ray(np.array([0.0, 0, 1]), np.array([1.0, 0, 0.1])), NOTHING) is None
    assert pick(Ray(np.array([0.0, 0, 1]), np.array([1.0, 0, 0])), NOTHING) is None


def test_a_distance_is_told_with_its_parts():
    assert describe([np.array([1.0, -2, 0.5])]) == "x 1.00, y -2.00, z 0.50 m"
    there = [np.array([1.0, 1, 0]), np.array([4.0, 5, 0])]
    assert describe(there) == "5.00 m (x +3.00, y +4.00, z +0.00)"


def test_clicks_on_the_page_tell_places_and_distances(port):
    runtime = Told(tf=Transforms, odom=Odometry, points=PointCloud)
    page = Page(ViewOptions(port=port))
    page.open(runtime)
    client = Client(port)
    try:
        runtime.say(tf=tf(transform("odom", "base_link", [3, 0, 0], 1)))
        runtime.say(odom=odometry([3, 0, 0]), points=cloud([[7, 0, 1]], "odom"))
        client.read_until(lambda: "/world/topics/points/points" in client.nodes)
        client.set("Click", "Show coordinates")
        place = "x 7.00, y 0.00, z 1.00 m in odom"
        client.read_until(lambda: click(client, [7, 0, 9]) or any(place in h for h in client.html))
        client.set("Click", "Measure distance")
        client.read_until(lambda: "/world/pins/0" not in client.nodes)
        click(client, [7, 0, 9])
        client.read_until(lambda: "/world/pins/0" in client.nodes)
        click(client, [2, 3, 9])
        client.read_until(lambda: any("5.92 m" in h for h in client.html))
    finally:
        client.close()
        page.close()


def test_a_click_sends_a_goal_that_looks_ahead(port):
    runtime = Told(inputs={"goal": PoseStamped}, tf=Transforms, odom=Odometry)
    page = Page(ViewOptions(port=port))
    page.open(runtime)
    client = Client(port)
    try:
        runtime.say(tf=tf(transform("map", "base_link", [3, 0, 0], 4)))
        runtime.say(odom=odometry([3, 0, 0], 4, "map"))
        client.set("Click", "Send goal: /goal")
        sent = "Goal sent: x 3.00, y 5.00, z 0.00 m in map"
        client.read_until(lambda: click(client, [3, 5, 9]) or any(sent in h for h in client.html))
    finally:
        client.close()
        page.close()
    topic, goal = runtime.taken[-1]
    assert (topic, goal.header.frame_id) == ("/goal", "map")
    assert np.allclose(goal.position_xyz, [3, 5, 0])
    assert np.allclose(goal.quat_xyzw, LEFT)


def click(client, above):
    """Click straight down from a place of the world, which has not moved yet."""
    client.send(
        {
            "type": "ScenePointerMessage",
            "event_type": "click",
            "ray_origin": tuple(map(float, above)),
            "ray_direction": (0.0, 0.0, -1.0),
            "screen_pos": [(0.5, 0.5)],
            "modifier": None,
        }
    )

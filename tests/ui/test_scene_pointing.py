"""The view after a time jump, the sizes of things, and clicks into the scene."""

import numpy as np
import pytest
from scene_messages import LEFT, cloud, draw, has, odometry, tf, transform

from ros_visualise.data import Header, NavSatFix, Odometry, PointCloud
from ros_visualise.ui.scene.picking import Ray, pick

S = 10**9
DOWN = Ray(np.array([0.0, 0, 10]), np.array([0.0, 0, -2]))
NOTHING = np.zeros((0, 3))


def test_after_a_jump_the_view_stays_at_the_robot_until_it_comes_again(scene, look):
    draw(scene, tf=tf(transform("odom", "base_link", [50, 8, 0], 9)))
    scene.forget()
    scene.refresh()
    assert look.update()["/view"]["robot"].tolist() == [50, 8, 0]
    draw(scene, tf=tf(transform("odom", "base_link", [1, 2, 0], 0.5)))
    assert look.update()["/view"]["robot"].tolist() == [1, 2, 0]


def test_a_jump_changes_no_frame_in_which_all_is_drawn(scene, clock):
    draw(scene, tf_static=tf(transform("base_link", "lidar", [0, 0, 1])))
    draw(scene, tf=tf(transform("odom", "base_link", [3, 0, 0], 1)))
    scene.forget()
    assert scene.frames.fixed == "odom"
    clock.now_s = 3.0
    scene.refresh()
    assert scene.frames.fixed == "base_link"  # it does not come again


def test_a_track_of_fixes_is_seen_along_its_way(scene, clock):
    for second in range(4):
        clock.now_s = second
        place = NavSatFix(48.0 + second * 1e-4, 11.0, 500.0, header=Header(second * S, "gps"))
        scene.show("/fix", place)
        draw(scene)
    view = np.subtract(scene.view.home[3:], scene.view.home[:3])[:2]
    assert view[1] < 0, "it went north: all of its way lies south of it"
    assert abs(view[0]) < 0.1 * abs(view[1])


def test_what_comes_a_little_later_and_is_larger_is_looked_at_too(scene, clock):
    points = 20 * np.stack([np.cos(np.arange(64)), np.sin(np.arange(64)), np.zeros(64)], axis=1)
    draw(scene, odom=odometry([0, 0, 0], 1))
    near = scene.view.home[2]
    clock.now_s = 0.5
    draw(scene, points=cloud(points, "odom"))
    far = scene.view.home[2]
    assert far > 2 * near
    scene.forget()
    clock.now_s = 2.0
    draw(scene, odom=odometry([0, 0, 0], 2))
    assert scene.view.home[2] == far, "the view does not fall back"


def test_of_frames_alone_the_one_that_moves_is_looked_at(scene, look):
    draw(scene, tf=tf(transform("start", "kinect", [200, 0, 0], 1, LEFT)))
    assert np.abs(scene.view.home[3]) < 3
    draw(scene, tf=tf(transform("start", "kinect", [203, 0, 0], 2, LEFT)))
    assert look.update()["/view"]["robot"].tolist() == [203, 0, 0]


@pytest.mark.parametrize(("reach_m", "size"), [(0.12, 0.2), (0.7, 0.7), (40.0, 1.5)])
def test_axes_are_sized_by_the_robot(scene, look, reach_m, size):
    parts = [transform("base_link", name, [0, 0, z]) for name, z in (("a", reach_m), ("b", 0.1))]
    draw(scene, tf_static=tf(*parts), tf=tf(transform("odom", "base_link", [1, 0, 0], 1)))
    assert look("axes", has("poses", 4))["length"] == pytest.approx(0.5 * size)


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

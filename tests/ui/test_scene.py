"""The scene as a browser is told of it."""

import numpy as np
import pytest
from scene_messages import (
    LEFT,
    LEVEL,
    S,
    cloud,
    draw,
    has,
    image,
    is_at,
    odometry,
    tf,
    transform,
)

from ros_visualise.data import (
    CameraInfo,
    Header,
    Image,
    Imu,
    LaserScan,
    NavSatFix,
    Odometry,
    Path,
    PointCloud,
    PoseWithCovarianceStamped,
    Text,
)
from ros_visualise.ui.scene.coloring import Coloring
from ros_visualise.ui.scene.drawing import Appearance

LINE = np.stack([np.arange(11.0), np.zeros(11), np.zeros(11)], axis=1)


def test_a_cloud_stands_where_its_frame_was_at_its_own_time(scene, look):
    moving = [transform("map", "lidar", [x, 2, 0], x, LEFT) for x in (0, 1, 2)]
    draw(scene, tf=tf(*moving), points=cloud(LINE, stamp_s=1.5))
    root = look("topics/points", is_at([1.5, 2, 0]))
    assert np.allclose(root["wxyz"], np.roll(LEFT, 1))
    node = look("topics/points/points", has("points", 11))
    assert node["points"].dtype == np.float16
    assert np.allclose(node["points"].reshape(-1, 3), LINE)
    assert len(node["colors"]) == 11


def test_a_wide_cloud_keeps_its_precision(scene, look):
    far = LINE + np.array([1000.123, 0, 0])
    draw(scene, points=cloud(far))
    node = look("topics/points/points", has("points", 11))
    assert node["points"].dtype == np.float32
    assert np.allclose(node["points"].reshape(-1, 3), far, atol=1e-3)


def test_a_cloud_is_changed_in_place(scene, look):
    draw(scene, points=cloud(LINE))
    look("topics/points/points", has("points", 11))
    draw(scene, points=cloud(LINE[:4], stamp_s=1.1))
    assert len(look("topics/points/points", has("points", 4))["colors"]) == 4


def test_what_a_person_chooses_for_all_clouds_changes_the_one_that_is_there(scene, look):
    draw(scene, points=cloud(LINE, intensity=np.arange(11.0)))
    before = look("topics/points/points", has("colors", 11))["colors"]
    scene.appearance = Appearance(max_points=5, point_size=0.25)
    scene.refresh()
    node = look("topics/points/points", has("points", 5))
    assert node["size"] == 0.25
    scene.appearance = Appearance()
    scene.set_coloring("/points", Coloring.HEIGHT)
    scene.refresh()
    look("topics/points/points", has("points", 11))
    look("topics/points/points", lambda node: not np.array_equal(node["colors"], before))


def test_everything_moves_with_the_fixed_frame(scene, look):
    turned = transform("map", "odom", [0, 0, 5], 0, LEFT)
    draw(scene, tf_static=tf(turned), tf=tf(transform("odom", "lidar", [1, 0, 0], 1)))
    draw(scene, points=cloud(LINE))
    look("topics/points", is_at([0, 1, 5]))
    scene.set_fixed("odom")
    scene.refresh()
    look("topics/points", is_at([1, 0, 0]))
    assert scene.frames.fixed == "odom"
    scene.set_fixed(None)
    scene.refresh()
    look("topics/points", is_at([0, 1, 5]))


def test_a_chosen_fixed_frame_holds_when_all_begins_anew(scene, look):
    frames = [
        tf(transform("map", "odom", [0, 0, 5], 1)),
        tf(transform("odom", "lidar", [1, 0, 0], 1)),
    ]
    scene.set_fixed("odom")
    for _ in range(2):
        draw(scene, tf_static=frames[0], tf=frames[1], points=cloud(LINE))
        look("topics/points", is_at([1, 0, 0]))
        scene.forget()


def test_a_message_waits_a_little_for_its_transform(scene, look, clock):
    draw(scene, tf=tf(transform("map", "lidar", [1, 0, 0], 1)), points=cloud(LINE, stamp_s=2))
    assert scene.is_waiting("/points")
    clock.now_s = 0.1
    draw(scene, tf=tf(transform("map", "lidar", [3, 0, 0], 3)))
    assert not scene.is_waiting("/points")
    look("topics/points", is_at([2, 0, 0]))


def test_then_the_newest_transform_has_to_do(scene, look, clock):
    draw(scene, tf=tf(transform("map", "lidar", [1, 0, 0], 1)), points=cloud(LINE, stamp_s=2))
    clock.now_s = 0.21
    scene.refresh()
    assert not scene.is_waiting("/points")
    look("topics/points", is_at([1, 0, 0]))


def test_what_cannot_be_placed_is_not_drawn_and_says_why(scene, look, clock):
    draw(scene, tf=tf(transform("map", "odom", [1, 0, 0], 1)), points=cloud(LINE))
    clock.now_s = 1.0
    scene.refresh()
    assert "lidar" in scene.problems["/points"]
    look("topics/points", lambda node: node.get("visible") is False)
    draw(scene, tf=tf(transform("odom", "lidar", [1, 0, 0], 1)), points=cloud(LINE))
    assert scene.problems == {}
    look("topics/points", lambda node: node["visible"])


def test_what_contradicts_itself_is_told_and_the_rest_is_drawn(scene, look):
    flat = np.zeros(3, [("x", np.float32), ("y", np.float32)])
    draw(scene, flat=PointCloud(flat, header=Header(S, "map")), points=cloud(LINE, "map"))
    look("topics/points/points", has("points", 11))
    assert "z" in scene.problems["/flat"]
    pose = PoseWithCovarianceStamped(np.zeros(3), np.zeros(4), header=Header(S, "map"))
    draw(scene, pose=pose)
    assert "quaternion" in scene.problems["/pose"]


def test_a_topic_can_be_hidden(scene, look):
    scene.follow({"/points": PointCloud})
    draw(scene, points=cloud(LINE))
    look("topics/points", lambda node: node["visible"])
    assert scene.wants("/points")
    scene.set_visible("/points", False)
    scene.refresh()
    assert not scene.wants("/points")
    look("topics/points", lambda node: not node["visible"])


def test_a_topic_that_has_gone_is_taken_away(scene, look):
    scene.follow({"/points": PointCloud, "/odom": Odometry})
    draw(scene, points=cloud(LINE, "odom"), odom=odometry([1, 2, 3]))
    look("topics/points/points")
    look("topics/odom/axes", is_at([1, 2, 3]))
    scene.follow({"/odom": Odometry})
    assert not [name for name in look.update() if name.startswith("/world/topics/points")]


def test_topics_below_one_another_do_not_move_each_other(scene, look):
    draw(scene, tf=tf(transform("map", "a", [1, 0, 0], 1), transform("map", "b", [2, 0, 0], 1)))
    draw(scene, **{"points": cloud(LINE, "a"), "points/filtered": cloud(LINE, "b")})
    look("topics/points", is_at([1, 0, 0]))
    look("topics/points.filtered", is_at([2, 0, 0]))


def test_odometry_leaves_a_trail_that_begins_anew_when_time_jumps_back(scene, look):
    for step in range(5):
        draw(scene, odom=odometry([step, 0, 0], 1 + step))
    look("topics/odom/axes", is_at([4, 0, 0]))
    segments = look("topics/odom/trail", lambda node: node["points"].max() == 4)["points"]
    assert np.allclose(segments.reshape(-1, 2, 3)[:4, :, 0], [[0, 1], [1, 2], [2, 3], [3, 4]])
    draw(scene, odom=odometry([7, 0, 0], 4.5))
    scene.forget()
    draw(scene, odom=odometry([9, 0, 0], 0.5))
    look("topics/odom/trail", lambda node: set(node["points"][:, :, 0].flat) <= {9.0})


def test_a_covariance_is_drawn_when_asked_for(scene, look):
    covariance = np.diag([0.25, 1.0, 4.0, 0, 0, 0])
    pose = PoseWithCovarianceStamped(np.ones(3), LEVEL, covariance, Header(S, "map"))
    draw(scene, pose=pose)
    look("topics/pose/covariance", lambda node: node["visible"] is False)
    scene.appearance = Appearance(covariances=True)
    scene.refresh()
    look("topics/pose/covariance", lambda node: node["visible"])
    ellipsoid = look("topics/pose/covariance", is_at([1, 1, 1]))
    assert np.allclose(sorted(ellipsoid["rows"][0, 7:10]), [2, 4, 8]), "2 standard deviations"


def test_a_long_path_is_drawn_whole_in_few_lines(scene, look):
    count = 20_000
    way = np.stack([np.arange(count) / 10, np.zeros(count), np.zeros(count)], axis=1)
    path = Path(np.arange(count), way, np.tile(LEVEL, (count, 1)), Header(S, "map"))
    draw(scene, path=path)
    points = look("topics/path/line", lambda node: len(node["points"]))["points"]
    assert len(points) == 4999
    assert points[0, 0].tolist() == [0, 0, 0]
    assert points[-1, 1, 0] == np.float32(1999.9)


def test_a_trail_far_from_the_origin_keeps_its_precision(scene, look):
    far = np.array([691_000.0, 5_334_000.0, 520])  # UTM
    for step in range(3):
        draw(scene, odom=odometry(np.add(far, [step * 0.1, 0, 0]), 1 + step))
    node = look("topics/odom/trail", lambda node: len(node["points"]) >= 2)
    ends = node["position"] + node["points"].astype(np.float64)
    assert np.allclose(ends[-1, 1] - far, [0.2, 0, 0], atol=1e-4)


def test_a_scan_is_drawn_in_its_frame(scene, look):
    scan = LaserScan([1, np.inf, 2], 0.0, np.pi, np.pi / 2, 0.1, 10.0, header=Header(S, "laser"))
    draw(scene, tf=tf(transform("base_link", "laser", [0, 0, 1], 1)), scan=scan)
    look("topics/scan", is_at([0, 0, 1]))
    points = look("topics/scan/points", has("points", 2))["points"]
    assert np.allclose(points, [[1, 0, 0], [-2, 0, 0]], atol=1e-3)


def test_fixes_are_on_a_plane_with_the_first_one_in_its_middle(scene, look):
    draw(scene, tf_static=tf(transform("map", "odom", [0, 0, 9])))
    scene.set_fixed("odom")
    for latitude in (48.0, 48.001):
        draw(scene, fix=NavSatFix(latitude, 11.0, 500.0, header=Header(S, "gps")))
    look("topics/fix", is_at([0, 0, -9]))
    look("topics/fix/fix", lambda node: np.allclose(node["position"], [0, 111.2, 0], atol=0.3))


def test_the_first_fix_is_where_its_frame_is(scene, look):
    draw(scene, tf=tf(transform("map", "gps", [7, 8, 2], 1)))
    for latitude in (48.0, 48.001):
        draw(scene, fix=NavSatFix(latitude, 11.0, 500.0, header=Header(S, "gps")))
    look("topics/fix/fix", lambda node: np.allclose(node["position"], [7, 119.2, 2], atol=0.3))


def test_a_track_below_its_start_is_over_the_grid_with_the_attitude_at_its_end(scene, look):
    for altitude in (500.0, 480.0):
        draw(scene, fix=NavSatFix(48.0, 11.0, altitude, header=Header(S, "gps")))
    draw(scene, imu=Imu(LEVEL, np.zeros(3), np.array([0, 0, 9.81]), header=Header(S, "base_link")))
    look("topics/imu", lambda node: np.allclose(node["position"], [0, 0, -20], atol=0.01))
    assert look.update()["/world/grid"]["position"][2] < -19.99


def test_whoever_looks_later_sees_fixes_at_the_same_places(scene, look):
    for second, latitude in ((1, 48.0), (2, 48.001)):
        scene.show("/fix", NavSatFix(latitude, 11.0, 500.0, header=Header(second * S, "gps")))
    scene.refresh()
    look("topics/fix/fix", lambda node: np.allclose(node["position"], [0, 111.2, 0], atol=0.3))
    scene.forget()
    draw(scene, fix=NavSatFix(48.001, 11.0, 500.0, header=Header(S, "gps")))
    look("topics/fix/fix", is_at([0, 0, 0]))


def test_no_fix_and_no_number_are_not_drawn(scene, look):
    draw(scene, fix=NavSatFix(1.0, 2.0, 3.0, status=-1, header=Header(S, "gps")))
    draw(scene, fix=NavSatFix(np.nan, np.nan, np.nan, header=Header(2 * S, "gps")))
    look("topics/fix/fix", lambda node: node["visible"] is False)


def test_an_imu_shows_attitude_and_acceleration_unless_it_does_not_measure_them(scene, look):
    unknown = np.diag([-1.0, 0, 0])
    gravity = np.array([0, 0, 9.81])
    header = Header(S, "imu")
    draw(scene, tf=tf(transform("map", "imu", [1, 0, 0], 1, LEFT)))
    draw(scene, imu=Imu(LEVEL, np.zeros(3), gravity, header=header))
    arrow = look("topics/imu/acceleration", lambda node: node["points"].any())["points"]
    assert arrow[0, 1, 2] > 0
    look("topics/imu/attitude", lambda node: node["visible"])
    turned = np.roll(LEFT, 1) * [1, -1, -1, -1]  # so that it is level in the map
    look("topics/imu/attitude", lambda node: np.allclose(abs(turned @ node["wxyz"]), 1))
    draw(scene, imu=Imu(LEVEL, np.zeros(3), gravity, unknown, header=header))
    look("topics/imu/attitude", lambda node: not node["visible"])


def test_an_image_stands_at_its_frustum_once_for_each_camera(scene, look):
    scene.follow({"/image_raw": Image, "/edges": Image, "/camera_info": CameraInfo})
    draw(scene, tf=tf(transform("map", "camera", [0, 0, 1], 1)))
    draw(scene, edges=image(), image_raw=image())
    node = look("topics/image_raw/camera")
    assert node["fov"] == pytest.approx(2 * np.arctan(60 / 100))
    assert node["aspect"] == pytest.approx(160 / 120)
    assert node["image"][:2] == b"\xff\xd8"
    look("topics/image_raw", lambda node: node["visible"])
    look("topics/edges", lambda node: not node["visible"])
    assert [scene.wants(topic) for topic in ("/image_raw", "/edges")] == [True, False]
    scene.set_visible("/image_raw", False)
    scene.refresh()
    look("topics/edges", lambda node: node["visible"])
    assert scene.wants("/edges")


def test_an_image_without_calibration_is_not_drawn(scene, look):
    draw(scene, image=image("map", calibrated=False), points=cloud(LINE, "map"))
    look("topics/points/points")
    assert "/world/topics/image/camera" not in look.update()


def test_all_frames_have_axes_and_names_when_asked_for(scene, look):
    draw(scene, tf=tf(transform("map", "a", [1, 0, 0], 1), transform("a", "b/c", [0, 2, 0], 1)))
    places = look("axes", has("poses", 3))["poses"][:, :3]
    assert np.allclose(places, [[1, 0, 0], [1, 2, 0], [0, 0, 0]])
    scene.appearance = Appearance(names=True)
    scene.refresh()
    assert look("frames/b.c")["text"] == "b/c"
    draw(scene, tf=tf(transform("map", "a", [5, 0, 0], 2), transform("a", "d", [0, 0, 1], 2)))
    look("axes", has("poses", 4))
    look("frames/a", lambda node: node["position"][0] == 5)
    scene.appearance = Appearance()
    scene.refresh()
    assert "/world/frames/a" not in look.update()


def test_close_frames_have_one_label_of_several_lines(scene, look):
    scene.appearance = Appearance(names=True)
    draw(scene, tf=tf(transform("map", "a", [0.1, 0, 0], 1), transform("map", "b", [9, 0, 0], 1)))
    assert look("frames/a")["text"] == "a\nmap"
    assert look("frames/b")["text"] == "b"
    scene.appearance = Appearance(names=True, axes_size=0.1)
    scene.refresh()
    look("frames/map", lambda node: node["text"] == "map")
    look("frames/a", lambda node: node["text"] == "a")


def test_browsers_hear_where_the_robot_and_all_frames_are(scene, look):
    for x in (1, 4):
        draw(scene, tf=tf(transform("map", "base_link", [x, 1, 0], x)))
    view = look.update()["/view"]
    assert view["robot"].tolist() == [4, 1, 0]
    places = dict(zip(view["frames"], view["places"].tolist(), strict=True))
    assert places == {"base_link": [4, 1, 0], "map": [0, 0, 0]}


def test_the_first_look_is_from_behind_and_above_the_robot(scene, look):
    ring = 10 * np.stack([np.cos(np.arange(64)), np.sin(np.arange(64)), np.zeros(64)], axis=1)
    draw(scene, tf=tf(transform("map", "base_link", [100, 0, 0], 1, LEFT)))
    draw(scene, points=cloud(ring, "base_link"))
    position, at = np.array(look.update()["/view"]["home"]).reshape(2, 3)  # from the robot
    assert np.allclose(position[0], 0, atol=0.1)  # it looks along y
    assert position[1] < -5
    assert position[2] > 3
    assert at[1] > 1


def test_of_images_alone_there_is_no_grid(scene, look):
    scene.follow({})
    look("grid", lambda node: node["visible"] is False)
    scene.follow({"/odom": Odometry})
    look("grid", lambda node: node["visible"])


def test_a_robot_s_links_follow_their_frames(scene, look):
    urdf = (
        '<robot name="r"><link name="base_link"><visual><origin xyz="0 0 0.5"/>'
        '<geometry><box size="1 2 3"/></geometry></visual></link></robot>'
    )
    draw(scene, robot_description=Text(urdf), tf=tf(transform("map", "base_link", [4, 0, 0])))
    look(
        "topics/robot_description/base_link",
        lambda node: is_at([4, 0, 0])(node) and node.get("visible"),
    )
    box = look("topics/robot_description/base_link/0", is_at([0, 0, 0.5]))
    assert (box["shape"], *box["rows"][0, 7:10]) == ("cube", 1, 2, 3)


def test_a_text_that_describes_no_robot_is_said(scene, caplog):
    draw(scene, robot_description=Text("<robot"))
    assert "not a valid URDF" in caplog.text

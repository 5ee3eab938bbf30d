"""What the scene is made of, without a page."""

import numpy as np
import pytest
from scene_messages import LEFT, S, cloud, tf, transform

from ros_visualise.core.errors import DamagedMessage, NoTransform
from ros_visualise.data import CameraInfo, Image, LaserScan, Odometry, Transforms
from ros_visualise.data.poses import is_static
from ros_visualise.geometry import rotations
from ros_visualise.ui.scene.axes import clusters
from ros_visualise.ui.scene.coloring import Coloring, colors_of, heights_of
from ros_visualise.ui.scene.drawings.cameras import view_of
from ros_visualise.ui.scene.drawings.lines import Trail, thinned
from ros_visualise.ui.scene.drawings.points import choose, ends_of
from ros_visualise.ui.scene.drawings.poses import ellipsoid
from ros_visualise.ui.scene.frames import Frames
from ros_visualise.ui.scene.kinds import is_beside_image, is_spatial
from ros_visualise.vision.measurements import turbo

BLUE, RED = turbo(np.array([0.0, 1]), 0, 1).tolist()
LINE = np.stack([np.zeros(11), np.zeros(11), np.arange(11.0)], axis=1)
PLAIN = (1, 2, 3)


def colors(message, coloring=Coloring.AUTO, T=None):
    points, xyz = choose(message, 1000)
    return colors_of(
        message, points, heights_of(xyz, np.eye(4) if T is None else T), coloring, PLAIN
    )


def test_turbo_goes_from_blue_to_red_and_holds_what_is_beyond():
    found = turbo(np.array([-5.0, 0, 1, 7, np.nan]), 0, 1)
    assert found.tolist() == [BLUE, BLUE, RED, RED, BLUE]
    assert np.abs(np.array([BLUE, RED]) - [[48, 18, 59], [122, 4, 2]]).max() <= 2


@pytest.mark.parametrize("kind", [np.float32, np.uint32])
def test_points_have_their_own_colors_where_they_have_any(kind):
    packed = np.full(11, 0x00C86432, np.uint32).view(kind)
    found = colors(cloud(LINE, rgb=packed, intensity=np.arange(11.0)))
    assert found.tolist() == [[200, 100, 50]] * 11
    apart = cloud(
        LINE,
        **{
            name: np.full(11, value, np.uint8) for name, value in zip("rgb", (9, 8, 7), strict=True)
        },
    )
    assert colors(apart).tolist() == [[9, 8, 7]] * 11


def test_without_colors_intensity_counts_and_without_that_height():
    falling = cloud(LINE, intensity=np.arange(11.0)[::-1])
    assert colors(falling)[0].tolist() == RED
    assert colors(falling, Coloring.HEIGHT)[0].tolist() == BLUE
    assert colors(cloud(LINE))[-1].tolist() == RED
    assert colors(cloud(LINE), Coloring.INTENSITY)[-1].tolist() == RED
    assert colors(falling, Coloring.PLAIN).tolist() == list(PLAIN)


def test_height_is_that_in_the_fixed_frame():
    T = np.eye(4)
    T[:3, :3] = rotations.to_matrix([1.0, 0, 0, 0])  # upside down
    T[2, 3] = 50
    assert colors(cloud(LINE), T=T)[0].tolist() == RED
    assert np.allclose(heights_of(LINE, T), 50 - LINE[:, 2])


def test_an_outlier_does_not_take_the_colors_from_the_others():
    heights = np.append(np.linspace(0, 1, 1000), 1e6)
    points = cloud(np.stack([heights * 0, heights * 0, heights], axis=1))
    assert np.ptp(colors(points)[:999].astype(int), axis=0).max() > 200


def test_points_that_are_none_are_left_out_and_many_are_thinned_evenly():
    xyz = np.stack([np.arange(100.0), np.zeros(100), np.zeros(100)], axis=1)
    xyz[7] = np.nan, 0, 0
    xyz[8] = 0, np.inf, 0
    points, chosen = choose(cloud(xyz), 1000)
    assert len(points) == len(chosen) == 98
    _, few = choose(cloud(xyz), 50)
    assert len(few) == 50
    assert few[0, 0] == 0
    assert few[-1, 0] == 99
    assert np.diff(few[:, 0]).max() <= 5


def test_rays_end_where_they_point_and_what_is_no_measurement_is_left_out():
    ranges = np.array([2, np.inf, np.nan, 0.05, 31, 3], np.float32)
    scan = LaserScan(ranges, -np.pi / 2, np.pi, np.pi / 2, 0.1, 30.0)
    points, valid = ends_of(scan)
    assert valid.tolist() == [True, False, False, False, False, True]
    assert np.allclose(points, [[0, -2, 0], [3, 0, 0]], atol=1e-6)


def test_a_trail_keeps_its_ends_and_its_shape_in_bounded_room():
    trail = Trail()
    for step in range(40_000):
        trail.add(step * S, np.array([0.1 * step, np.sin(step / 500), 0]))
    way = trail.vertices
    assert len(way) <= 5001
    assert np.allclose(way[0], 0)
    assert np.allclose(way[-1, 0], 3999.9)
    assert np.abs(way[:, 1] - np.sin(way[:, 0] * 10 / 500)).max() < 1e-9


def test_a_trail_that_stands_still_does_not_grow():
    trail = Trail()
    for step in range(1000):
        trail.add(step * S, np.array([0.001 * (step % 5), 0, 0]))
    assert len(trail.vertices) <= 2


def test_a_trail_begins_anew_after_a_jump_through_space():
    trail = Trail()
    trail.add(0, np.zeros(3))
    trail.add(S, np.ones(3))
    trail.add(S // 2, np.array([2, 0, 0]))  # is late
    assert set(trail.vertices[:, 0]) == {0, 1}
    trail.add(11 * S // 10, np.array([1000, 0, 0]))
    assert set(trail.vertices[:, 0]) == {1000}


def test_thinned_vertices_keep_first_and_last():
    many = np.arange(30_000.0)[:, None] * np.ones(3)
    few = thinned(many)
    assert len(few) == 5000
    assert few[0, 0] == 0
    assert few[-1, 0] == 29_999


def test_an_ellipsoid_has_two_deviations_along_its_axes():
    R = rotations.to_matrix(rotations.from_rpy([0.3, -0.2, 1.0]))
    covariance = R @ np.diag([0.04, 0.25, 1.0]) @ R.T
    scale, wxyz = ellipsoid(covariance)
    assert np.allclose(scale, [0.4, 1.0, 2.0])
    turned = rotations.to_matrix(np.roll(wxyz, -1))
    assert np.allclose(turned @ np.diag(np.square(scale)) @ turned.T, 4 * covariance)


def test_a_camera_sees_what_its_matrix_says():
    info = CameraInfo(480, 640, np.array([[500.0, 0, 320], [0, 250, 240], [0, 0, 1]]))
    fov, aspect = view_of(info)
    assert np.tan(fov / 2) == pytest.approx(240 / 250)
    assert np.tan(fov / 2) * aspect == pytest.approx(320 / 500)
    assert view_of(CameraInfo.uncalibrated(480, 640)) is None


def test_what_needs_a_scene():
    assert is_spatial(Odometry)
    assert is_spatial(Transforms)
    assert not is_spatial(Image)
    assert not is_spatial(CameraInfo)
    assert is_static("/robot/tf_static")
    assert not is_static("/tf")
    kinds = {"/a/image": Image, "/a/camera_info": CameraInfo, "/b/camera_info": CameraInfo}
    assert [is_beside_image(name, kinds) for name in kinds] == [False, True, False]


def frames_of(*transforms):
    frames = Frames()
    frames.add(tf(*transforms), static=False)
    return frames


def test_without_transforms_the_fixed_frame_is_that_of_the_most_topics():
    frames = Frames()
    for topic, frame in {"/a": "truth", "/b": "", "/c": "", "/d": "slam", "/e": "slam"}.items():
        frames.see(frame, topic)
    assert frames.fixed == "slam"


def test_the_fixed_frame_is_the_outermost_of_rep_105():
    assert Frames().fixed == ""
    frames = Frames()
    frames.see("/laser")
    frames.see("odom")
    assert frames.fixed == "odom"
    frames.add(tf(transform("world", "base_link", [0, 0, 0])), static=False)
    assert frames.fixed == "world"
    frames.add(tf(transform("odom", "world", [0, 0, 0])), static=False)
    assert frames.fixed == "odom"
    frames.add(tf(transform("map", "odom", [0, 0, 0])), static=False)
    assert frames.fixed == "map"
    frames.chosen = "base_link"
    assert frames.fixed == "base_link"
    frames.chosen = "gone"
    assert frames.fixed == "map"
    assert frames.names == ["base_link", "laser", "map", "odom", "world"]


def test_of_several_trees_the_largest_counts():
    frames = frames_of(
        transform("a", "a1", [0, 0, 0]),
        transform("b", "b1", [0, 0, 0]),
        transform("b1", "b2", [0, 0, 0]),
    )
    assert frames.fixed == "b"


def test_a_place_is_that_at_the_time_itself_and_else_the_newest():
    frames = frames_of(
        transform("map", "base_link", [0, 0, 0], 1), transform("map", "base_link", [10, 0, 0], 2)
    )
    assert frames.locate("base_link", int(1.5 * S))[0, 3] == pytest.approx(5)
    assert frames.locate("base_link", 3 * S)[0, 3] == 10
    with pytest.raises(NoTransform):
        frames.locate("base_link", 3 * S, patient=True)
    assert frames.locate("base_link", 0)[0, 3] == 10
    assert np.array_equal(frames.locate("", 5), np.eye(4))
    with pytest.raises(NoTransform):
        frames.locate("nowhere", S)


def test_a_transform_that_is_none_does_not_hide_the_others():
    frames = frames_of(
        transform("map", "odom", [0, 0, 0], quat=np.zeros(4)),
        transform("map", "b", [1, 0, 0], quat=LEFT),
    )
    assert frames.names == ["b", "map"]
    assert [link.child for link in frames.links.all()] == ["b"]


def test_links_tell_rate_and_age():
    frames = Frames()
    frames.add(tf(transform("base_link", "camera", [0, 0, 0], 7)), static=True)
    for step in range(11):
        frames.add(tf(transform("odom", "base_link", [0, 0, 0], 1 + step / 10)), static=False)
    moving, static = frames.links.all()
    assert (moving.parent, moving.child, moving.static) == ("odom", "base_link", False)
    assert moving.rate_hz == pytest.approx(10)
    assert moving.stamp_ns == 2 * S
    assert static.static
    assert static.rate_hz is None
    frames.forget()
    frames.add(tf(transform("odom", "base_link", [0, 0, 0], 0.5)), static=False)
    assert frames.links.all()[0].stamp_ns == S // 2


def test_frames_that_are_close_together_share_a_label():
    frames = frames_of(
        transform("base_link", "camera", [2, 0, 0]),
        transform("camera", "camera_optical", [0.1, 0, 0]),
        transform("base_link", "imu", [0, 0.3, 0]),
        transform("base_link", "lidar", [0, 0, 0.8]),
    )
    groups = clusters(frames.places(), 0.5)
    assert {name: group.names for name, group in groups.items()} == {
        "base_link": ["base_link", "imu"],
        "camera": ["camera", "camera_optical"],
        "lidar": ["lidar"],
    }
    assert np.allclose(groups["camera"].centre, [2, 0, 0])
    assert len(clusters(frames.places(), 0.05)) == 5


def test_angles_that_are_no_numbers_are_refused():
    for start, step in ((np.nan, 0.1), (0.0, np.inf)):
        with pytest.raises(DamagedMessage, match="angles"):
            ends_of(LaserScan([1.0, 2.0], start, 1.0, step, 0.1, 10.0))


def test_a_camera_whose_matrix_is_no_number_sees_nothing():
    for focal in (np.nan, np.inf):
        assert view_of(CameraInfo(480, 640, np.diag([focal, 250.0, 1]))) is None

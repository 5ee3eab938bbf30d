"""Markers in the scene: what is added, moved, deleted and at its end."""

import numpy as np
import pytest
import trimesh
from scene_messages import LEFT, LEVEL, S, draw, has, is_at, tf, transform
from scene_runtime import Told

from ros_visualise.data import Header, Marker, MarkerAction, MarkerArray, MarkerType, Odometry
from ros_visualise.ui.scene.meshes import load_mesh
from ros_visualise.ui.scene.solids import solids_of
from ros_visualise.ui.scene.thread import SceneThread

POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0]])
RED_GREEN_BLUE = np.array([[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1]], np.float32)


def marker(kind=MarkerType.CUBE, xyz=(0, 0, 0), frame="map", stamp_s=1.0, **rest):
    return Marker(kind, np.array(xyz, float), header=Header(int(stamp_s * S), frame), **rest)


def positions(xyz):
    """Whether copies of a solid are there."""
    return lambda node: len(node["rows"]) == len(xyz) and np.allclose(node["rows"][:, :3], xyz)


def test_solids_have_their_places_sizes_and_colors(scene, look):
    red = np.array([1, 0, 0, 1], np.float32)
    one = marker(xyz=[1, 2, 3], scale_xyz=[2, 4, 6], color_rgba=red, id=1)
    several = marker(
        MarkerType.CUBE_LIST, [0, 0, 5], points_xyz=POINTS, colors_rgba=RED_GREEN_BLUE, id=2
    )
    draw(scene, shapes=MarkerArray((one, several, marker(MarkerType.SPHERE, id=3))))
    node = look("topics/shapes/cube", positions([[1, 2, 3], [0, 0, 5], [1, 0, 5], [1, 1, 5]]))
    assert node["rows"][0, 7:10].tolist() == [2, 4, 6]
    assert node["rows"][:, 10:13].tolist() == [[1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    look("topics/shapes/sphere", positions([[0, 0, 0]]))


def test_a_marker_that_cannot_be_seen_is_left_out_and_a_clear_one_is_clear(scene, look):
    clear = np.array([1, 1, 1, 0.25], np.float32)
    gone = np.array([1, 1, 1, 0], np.float32)
    draw(scene, shapes=MarkerArray((marker(color_rgba=clear), marker(id=1, color_rgba=gone))))
    node = look("topics/shapes/cube", positions([[0, 0, 0]]))
    assert np.allclose(node["rows"][:, 13], [0.25])


def test_arrows_go_along_x_or_from_point_to_point():
    shaft, head = solids_of(marker(MarkerType.ARROW, scale_xyz=[1, 0.1, 0.2]))
    assert (shaft.kind, head.kind) == ("cylinder", "cone")
    top = head.T[0] @ [0, 0, head.scales[0, 2], 1]
    assert np.allclose(top[:3], [1, 0, 0])
    assert np.allclose(np.abs(shaft.T[0, :3, :3] @ shaft.scales[0]), [0.77, 0.1, 0.2])
    two = marker(MarkerType.ARROW, scale_xyz=[0.1, 0.3, 0.5], points_xyz=[[0, 0, 1], [0, 0, 3]])
    shaft, head = solids_of(two)
    assert np.allclose(head.T[0, :3, 3], [0, 0, 2.5])
    assert np.allclose(shaft.T[0, :3, 3], [0, 0, 1.75])
    assert np.allclose(shaft.scales, [[0.1, 0.1, 1.5]])
    strip = marker(MarkerType.ARROW_STRIP, scale_xyz=[0.1, 0.3, 0], points_xyz=POINTS)
    assert [len(one.T) for one in solids_of(strip)] == [2, 2]


def test_lines_have_the_colors_of_their_points(scene, look):
    strip = marker(
        MarkerType.LINE_STRIP,
        points_xyz=POINTS,
        colors_rgba=RED_GREEN_BLUE,
        scale_xyz=[0.05, 0, 0],
    )
    lines = marker(MarkerType.LINE_LIST, id=1, points_xyz=POINTS)  # the last has no partner
    draw(scene, shapes=MarkerArray((strip, lines)))
    node = look("topics/shapes/1/shape", has("points", 2))
    assert node["points"].tolist() == [
        [[0, 0, 0], [1, 0, 0]],
        [[1, 0, 0], [1, 1, 0]],
    ]
    assert node["colors"][1].tolist() == [[0, 255, 0], [0, 0, 255]]
    assert (node["width"], node["in_metres"]) == (pytest.approx(0.05), True)
    look("topics/shapes/2/shape", has("points", 1))


def test_points_texts_and_triangles_are_drawn(scene, look):
    draw(
        scene,
        shapes=MarkerArray(
            (
                marker(MarkerType.POINTS, points_xyz=POINTS, scale_xyz=[0.2, 0.2, 0]),
                marker(MarkerType.TEXT_VIEW_FACING, [0, 0, 9], id=1, text="dock <1>"),
                marker(
                    MarkerType.TRIANGLE_LIST, id=2, points_xyz=POINTS, colors_rgba=RED_GREEN_BLUE
                ),
            )
        ),
    )
    assert look("topics/shapes/1/shape", has("points", 3))["size"] == pytest.approx(0.2)
    assert look("topics/shapes/2/shape")["text"] == "dock <1>"
    look("topics/shapes/2", is_at([0, 0, 9]))
    mesh = look("topics/shapes/3/shape")
    assert (mesh["vertices"].shape, mesh["faces"].tolist()) == ((3, 3), [[0, 1, 2]])
    assert mesh["colors"].tolist() == (255 * RED_GREEN_BLUE).tolist()


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A robot's package with a mesh, beside a file that is none of its."""
    (tmp_path / "robot" / "meshes").mkdir(parents=True)
    trimesh.creation.box(extents=[1, 2, 3]).export(tmp_path / "robot" / "meshes" / "base.stl")
    (tmp_path / "secret.stl").write_bytes(b"solid")
    (tmp_path / "robot" / "base.dae").write_text("<COLLADA/>")
    (tmp_path / "robot" / "torn.stl").write_bytes(bytes(90))
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path))
    return tmp_path


def test_a_mesh_is_drawn_in_its_size_and_color(scene, look, package):
    draw(
        scene,
        shapes=marker(
            MarkerType.MESH_RESOURCE,
            mesh_resource="package://robot/meshes/base.stl",
            scale_xyz=[2, 1, 1],
            color_rgba=[1, 0, 0, 1],
        ),
    )
    node = look("topics/shapes/1/shape")
    assert np.ptp(node["vertices"], axis=0).tolist() == [2, 2, 3]
    assert node["colors"] == [255, 0, 0]


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("package://robot/../secret.stl", "outside its package"),
        ("package://robot/%2e%2e/secret.stl", "outside its package"),
        ("package://robot/base.dae", "not a mesh|cannot be read"),
        ("package://robot/base.glb", "supported: .stl, .obj, .dae"),
        ("package://robot/torn.stl", "not a mesh"),
        ("package://robot/none.stl", "no such file"),
        ("file:///dev/zero", "unsupported format"),
        ("http://127.0.0.1/a.stl", "package://PACKAGE/FILE"),
        ("", "package://PACKAGE/FILE"),
    ],
)
def test_a_mesh_that_is_not_read_is_said(package, name, why):
    with pytest.raises(ValueError, match=why):
        load_mesh(name)


def test_a_marker_that_only_moves_is_not_made_anew(scene, look):
    text = marker(MarkerType.TEXT_VIEW_FACING, text="dock")
    draw(scene, shapes=MarkerArray((text,)))
    look("topics/shapes/1/shape")
    draw(scene, shapes=MarkerArray((marker(MarkerType.TEXT_VIEW_FACING, [1, 0, 0], text="dock"),)))
    look("topics/shapes/1", is_at([1, 0, 0]))
    draw(scene, shapes=MarkerArray((marker(MarkerType.TEXT_VIEW_FACING, text="quay"),)))
    assert look("topics/shapes/2/shape")["text"] == "quay"
    assert "/world/topics/shapes/1" not in look.update()


def test_a_marker_is_replaced_and_deleted_by_its_name(scene, look):
    draw(scene, shapes=MarkerArray((marker(ns="a"), marker(xyz=[5, 0, 0], ns="b"))))
    look("topics/shapes/cube", positions([[0, 0, 0], [5, 0, 0]]))
    draw(scene, shapes=MarkerArray((marker(xyz=[1, 0, 0], ns="a"),)))
    look("topics/shapes/cube", positions([[1, 0, 0], [5, 0, 0]]))
    draw(scene, shapes=MarkerArray((marker(ns="b", action=MarkerAction.DELETE),)))
    look("topics/shapes/cube", positions([[1, 0, 0]]))
    everything = marker(action=MarkerAction.DELETEALL)
    draw(scene, shapes=MarkerArray((everything, marker(xyz=[7, 0, 0]))))
    look("topics/shapes/cube", positions([[7, 0, 0]]))


def test_a_marker_ends_with_its_lifetime_in_the_time_of_the_data(scene, look):
    draw(scene, shapes=MarkerArray((marker(lifetime_ns=2 * S), marker(id=1, xyz=[3, 0, 0]))))
    look("topics/shapes/cube", positions([[0, 0, 0], [3, 0, 0]]))
    draw(scene, tf=tf(transform("map", "odom", [0, 0, 0], 2.9)))
    look("topics/shapes/cube", positions([[0, 0, 0], [3, 0, 0]]))
    draw(scene, tf=tf(transform("map", "odom", [0, 0, 0], 3.1)))
    look("topics/shapes/cube", positions([[3, 0, 0]]))


def test_where_time_cannot_stop_a_marker_ends_though_nothing_comes(scene, look, clock):
    scene.time.is_live = True
    draw(scene, shapes=MarkerArray((marker(lifetime_ns=2 * S), marker(id=1, xyz=[3, 0, 0]))))
    look("topics/shapes/cube", positions([[0, 0, 0], [3, 0, 0]]))
    clock.now_s += 2.5
    scene.refresh()
    look("topics/shapes/cube", positions([[3, 0, 0]]))


def test_markers_stay_where_their_frame_was_unless_they_are_locked_to_it(scene, look):
    turned = transform("map", "base_link", [10, 0, 0], 1, LEFT)
    draw(scene, tf=tf(turned, transform("map", "base_link", [10, 0, 0], 1.5, LEFT)))
    there = marker(xyz=[1, 0, 0], frame="base_link", quat_xyzw=LEVEL)
    locked = marker(xyz=[2, 0, 0], frame="base_link", id=1, frame_locked=True)
    draw(scene, shapes=MarkerArray((there, locked)))
    look("topics/shapes/cube", positions([[10, 1, 0], [10, 2, 0]]))
    draw(scene, tf=tf(transform("map", "base_link", [20, 0, 0], 2, LEFT)))
    look("topics/shapes/cube", positions([[10, 1, 0], [20, 2, 0]]))


def test_a_marker_of_an_unknown_frame_is_said_and_drawn_when_that_is_there(scene, look):
    draw(scene, tf=tf(transform("map", "odom", [0, 0, 0], 1)))
    draw(scene, shapes=MarkerArray((marker(), marker(id=1, frame="dock"))))
    look("topics/shapes/cube", positions([[0, 0, 0]]))
    assert "dock" in scene.problems["/shapes"]
    draw(scene, tf=tf(transform("map", "dock", [4, 0, 0], 1)))
    look("topics/shapes/cube", positions([[0, 0, 0], [4, 0, 0]]))
    assert "/shapes" not in scene.problems


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (marker(99, id=1), "type 99"),
        (marker(xyz=[np.nan, 0, 0], id=1), "not a number"),
        (marker(MarkerType.TRIANGLE_LIST, id=1), "three points"),
        (
            marker(MarkerType.MESH_RESOURCE, id=1, mesh_resource="package://no/a.stl"),
            "package no not found",
        ),
    ],
)
def test_a_marker_that_cannot_be_drawn_is_said_and_the_others_are_drawn(scene, look, wrong, said):
    no_turn = marker(xyz=[1, 1, 1], id=2, quat_xyzw=np.zeros(4))
    draw(scene, shapes=MarkerArray((wrong, no_turn)))
    look("topics/shapes/cube", positions([[1, 1, 1]]))
    assert said in scene.problems["/shapes"]


def test_no_marker_is_lost_while_nobody_looks(scene, look):
    runtime = Told(shapes=MarkerArray, odom=Odometry)
    watched = []
    thread = SceneThread(runtime, scene, lambda: bool(watched), lambda: False)
    thread.follow(runtime.graph)
    for number in range(5):
        runtime.say(shapes=MarkerArray((marker(xyz=[number, 0, 0], id=number),)))
    thread.start()
    watched.append(1)
    try:
        look("topics/shapes/cube", positions([[n, 0, 0] for n in range(5)]))
    finally:
        thread.close(5.0)

"""Of many markers, only what changed is made anew."""

import numpy as np
from scene_messages import S, draw, is_at, tf, transform

from ros_visualise.data import Header, Marker, MarkerAction, MarkerArray, MarkerType
from ros_visualise.ui.scene.drawings import markers

EVERYTHING = Marker(MarkerType.CUBE, action=MarkerAction.DELETEALL)


def marker(number, x=0.0, kind=MarkerType.CUBE, stamp_s=1.0, frame="map", **rest):
    header = Header(int(stamp_s * S), frame)
    return Marker(kind, np.array([x, number, 0.0]), id=number, header=header, **rest)


def positions(xyz):
    """Whether copies of a solid are there."""
    return lambda node: len(node["rows"]) == len(xyz) and np.allclose(node["rows"][:, :3], xyz)


def counted(monkeypatch, name):
    """The calls of a function of `markers` from now on."""
    calls, work = [], getattr(markers, name)
    monkeypatch.setattr(markers, name, lambda *given: calls.append(given) or work(*given))
    return calls


def test_one_changed_cube_of_a_thousand_is_placed_alone(scene, look, monkeypatch):
    draw(scene, shapes=MarkerArray(tuple(marker(n) for n in range(1000))))
    placed = counted(monkeypatch, "pose_of")
    draw(scene, shapes=MarkerArray((marker(7, 5.0),)))
    scene.refresh()
    assert [one.id for (one,) in placed] == [7]
    there = [[5.0 if n == 7 else 0.0, n, 0.0] for n in range(1000)]
    look("topics/shapes/cube", positions(there))


def test_cubes_that_only_move_are_the_same_cubes(scene, look, monkeypatch):
    draw(scene, shapes=MarkerArray(tuple(marker(n) for n in range(3))))
    made = counted(monkeypatch, "solids_of")
    draw(scene, shapes=MarkerArray((EVERYTHING, *(marker(n, 1.0) for n in range(3)))))
    assert not made
    look("topics/shapes/cube", positions([[1, 0, 0], [1, 1, 0], [1, 2, 0]]))


def test_cubes_have_one_node_for_all_of_them(scene, look):
    draw(scene, shapes=MarkerArray(tuple(marker(n) for n in range(20))))
    look("topics/shapes/cube", positions([[0, n, 0] for n in range(20)]))
    assert sum(name.startswith("/world/topics/shapes/") for name in look.update()) == 1


def test_a_text_that_is_deleted_and_added_again_stays(scene, look):
    def say(x):
        text = marker(0, x, MarkerType.TEXT_VIEW_FACING, text="dock")
        draw(scene, shapes=MarkerArray((EVERYTHING, text)))

    for x in range(5):
        say(x)
    look("topics/shapes/1", is_at([4, 0, 0]))
    assert look("topics/shapes/1/shape")["text"] == "dock"
    assert "/world/topics/shapes/2" not in look.update()


def test_a_cube_that_becomes_a_sphere_is_no_cube_any_more(scene, look):
    draw(scene, shapes=MarkerArray((marker(0), marker(1))))
    look("topics/shapes/cube", positions([[0, 0, 0], [0, 1, 0]]))
    draw(scene, shapes=MarkerArray((marker(1, kind=MarkerType.SPHERE),)))
    look("topics/shapes/sphere", positions([[0, 1, 0]]))
    look("topics/shapes/cube", positions([[0, 0, 0]]))


def test_a_list_that_grows_is_drawn_whole(scene, look):
    for count in (2, 2, 3, 1):
        points = np.column_stack([np.zeros(count), np.zeros(count), np.arange(count)])
        several = marker(0, kind=MarkerType.CUBE_LIST, points_xyz=points)
        draw(scene, shapes=MarkerArray((several, marker(1, 9.0))))
        rows = [*points.tolist(), [9, 1, 0]]
        look("topics/shapes/cube", lambda node, rows=rows: sorted_rows(node) == sorted(rows))


def sorted_rows(node):
    return sorted(node["rows"][:, :3].tolist())


def test_what_cannot_be_drawn_any_more_goes(scene, look):
    text = marker(1, kind=MarkerType.TEXT_VIEW_FACING, text="dock")
    draw(scene, shapes=MarkerArray((marker(0), marker(2), text)))
    look("topics/shapes/1/shape")
    wrong = marker(1, np.nan, MarkerType.TEXT_VIEW_FACING, text="dock")
    draw(scene, shapes=MarkerArray((marker(0, np.nan), wrong)))
    look("topics/shapes/cube", positions([[0, 2, 0]]))
    assert "/world/topics/shapes/1" not in look.update()
    draw(scene, shapes=MarkerArray((marker(0, 3.0),)))
    look("topics/shapes/cube", lambda node: sorted_rows(node) == [[0, 2, 0], [3, 0, 0]])


def test_all_go_to_where_their_frame_is_in_another_fixed_frame(scene, look):
    draw(scene, tf=tf(transform("map", "odom", [10, 0, 0], 1)))
    draw(scene, shapes=MarkerArray((marker(0), marker(1, frame="odom"))))
    look("topics/shapes/cube", positions([[0, 0, 0], [10, 1, 0]]))
    scene.set_fixed("odom")
    scene.refresh()
    look("topics/shapes/cube", positions([[-10, 0, 0], [0, 1, 0]]))

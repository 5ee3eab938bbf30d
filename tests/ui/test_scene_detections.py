"""Things that were detected in space, in the scene."""

import numpy as np
from scene_messages import LEVEL, S, draw

from ros_visualise.data import (
    Detection3D,
    Detections3D,
    Header,
    Hypothesis,
    Marker,
    MarkerArray,
    MarkerType,
)
from ros_visualise.plotting.colors import color_of


def thing(xyz, name="dog", size=(1, 2, 3), quat=LEVEL):
    return Detection3D(np.array(xyz, float), quat, np.array(size, float), (Hypothesis(name, 0.5),))


def found(*several, stamp_s=1.0):
    return Detections3D(several, Header(int(stamp_s * S), "map"))


def positions(xyz):
    return lambda node: len(node["rows"]) == len(xyz) and np.allclose(node["rows"][:, :3], xyz)


def test_boxes_have_their_sizes_classes_and_scores(scene, look):
    draw(scene, found=found(thing([1, 0, 0]), thing([5, 0, 0], "cat")))
    node = look("topics/found/boxes", positions([[1, 0, 0], [5, 0, 0]]))
    assert node["rows"][0, 7:10].tolist() == [1, 2, 3]
    assert np.allclose(255 * node["rows"][:, 10:13], [color_of("dog"), color_of("cat")])
    assert look("topics/found/label0")["text"] == "dog 0.50"
    assert np.allclose(look("topics/found/label1")["position"], [5, 0, 1.5])


def test_what_is_not_found_any_more_goes_with_its_label(scene, look):
    draw(scene, found=found(thing([1, 0, 0]), thing([5, 0, 0])))
    look("topics/found/label1")
    draw(scene, found=found(thing([2, 0, 0]), stamp_s=2.0))
    look("topics/found/boxes", positions([[2, 0, 0]]))
    look("topics/found/label1", lambda node: node["visible"] is False)


def test_a_box_that_is_none_is_said(scene):
    draw(scene, found=found(thing([np.nan, 0, 0])))
    assert "not a number" in scene.problems["/found"]
    draw(scene, found=found(thing([1, 0, 0], quat=np.zeros(4)), stamp_s=2.0))
    assert "quaternion" in scene.problems["/found"]


def test_what_markers_name_too_is_drawn_once(scene, look):
    def named(text):
        return Marker(MarkerType.TEXT_VIEW_FACING, text=text, header=Header(S, "map"))

    tag = Detection3D(np.zeros(3), LEVEL, np.ones(3), (Hypothesis("tag36h11_4", 0.9),), "tag_4")
    scene.follow({"/found": Detections3D, "/markers": MarkerArray})
    draw(scene, found=found(tag))
    assert not scene.is_covered("/found")
    draw(scene, markers=MarkerArray((named("tag_5"),)))
    assert not scene.is_covered("/found")
    draw(scene, markers=MarkerArray((named("tag_4"),)))
    assert scene.is_covered("/found")
    look("topics/found", lambda node: node["visible"] is False)
    scene.set_visible("/markers", False)
    assert not scene.is_covered("/found")

"""What a declaration of several inputs must say, and what is answered where it does not."""

import pytest

from ros_visualise.data import Image, PoseArray
from ros_visualise.errors import UsageError
from ros_visualise.joining import Approx, Exact, Latest
from ros_visualise.nodes import node

TWO = {"image": Image, "boxes": PoseArray}


def declared(step, inputs=TWO, **rest):
    return node("locator", inputs=inputs, outputs={"image": Image}, **rest)(step).declared


def test_a_step_takes_the_joined_inputs_by_name_and_the_frames_last():
    found = declared(lambda image, boxes, params, frames: image, join=Exact(), frames=True)
    assert list(found.stepped) == ["image", "boxes"]
    assert list(found.inputs) == ["image", "boxes", "tf", "tf_static"]
    assert found.join == Exact()


@pytest.mark.parametrize(
    ("step", "options", "says"),
    [
        (
            lambda image, params: None,
            {"join": Exact()},
            "node locator: its step is given image, boxes, params, but takes image, params",
        ),
        (
            lambda image, boxes, params: None,
            {"join": Exact(), "frames": True},
            "its step is given image, boxes, params, frames, but takes image, boxes, params",
        ),
        (
            lambda image, boxes, params: None,
            {},
            "its step is given image, params, but takes image, boxes, params",
        ),
        (
            lambda params, image=None, boxes=None: None,
            {"join": Latest("picture")},
            "node locator: no input 'picture'; choose from image, boxes",
        ),
        (
            lambda image, params: None,
            {"inputs": {"image": Image}, "join": Approx(0.1)},
            r"node locator: Approx\(slop_s=0.1\) joins several inputs, and this node has image",
        ),
        (
            lambda image, boxes, params: None,
            {"join": Exact},
            r"node locator: join=.*Exact.*: give Each\(\), Exact\(\), Approx",
        ),
        (
            lambda image, params: None,
            {"inputs": {"image": 3}},
            "node locator: 3 is no message; choose from CameraInfo",
        ),
        (
            lambda params, **_: None,
            {"inputs": {"the image": Image}},
            "node locator: the image: a name is made of letters",
        ),
        (
            lambda params: None,
            {"inputs": {"params": Image}},
            "node locator: its step is given params already; rename the input",
        ),
        (
            type("Empty", (), {"__init__": lambda self, params: None}),
            {},
            "node locator: the class Empty has no method step",
        ),
        (
            type("Bare", (), {"step": lambda self, params, image=None, boxes=None: None}),
            {},
            "node locator: its __init__ is given params, but takes nothing",
        ),
        (
            lambda boxes, params: None,
            {"inputs": {"boxes": PoseArray}, "calibrated": True},
            "node locator: calibrated=True is for inputs of type Image; it has none",
        ),
    ],
)
def test_what_does_not_fit_is_said_when_it_is_declared(step, options, says):
    with pytest.raises(UsageError, match=says):
        declared(step, **options)


@pytest.mark.parametrize("name", ["", "a b", "uav1/locator", "1st", "localisée"])
def test_a_node_has_a_name_that_a_topic_may_have(name):
    with pytest.raises(UsageError, match="a name is made of letters, digits and _"):
        node(name, inputs={"image": Image}, outputs={"image": Image})

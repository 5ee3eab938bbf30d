"""What a declaration of several inputs must say, and what is answered where it does not."""

import pytest

from ros_visualise.core.errors import UsageError
from ros_visualise.core.synchronizer import Approximate, Exact, Latest
from ros_visualise.data import Image, PoseArray
from ros_visualise.nodes import node

TWO = {"image": Image, "boxes": PoseArray}


def declared(step, inputs=TWO, **rest):
    return node("locator", inputs=inputs, outputs={"image": Image}, **rest)(step).declared


def test_a_step_takes_the_joined_inputs_by_name_and_the_frames_last():
    found = declared(lambda image, boxes, params, frames: image, sync=Exact(), frames=True)
    assert list(found.stepped) == ["image", "boxes"]
    assert list(found.inputs) == ["image", "boxes", "tf", "tf_static"]
    assert found.sync == Exact()


@pytest.mark.parametrize(
    ("step", "options", "says"),
    [
        (
            lambda image, params: None,
            {"sync": Exact()},
            "node locator: its step must take image, boxes, params, not image, params",
        ),
        (
            lambda image, boxes, params: None,
            {"sync": Exact(), "frames": True},
            "its step must take image, boxes, params, frames, not image, boxes, params",
        ),
        (
            lambda image, boxes, params: None,
            {},
            r"its step must take image, params, not image, boxes, params: messages arrive one"
            r" at a time; to match them by stamp, add sync=Exact\(\), Approximate\(SECONDS\) or"
            r" Latest\('image'\); otherwise give every input the default None",
        ),
        (
            lambda params, image=None, boxes=None: None,
            {"sync": Latest("picture")},
            "node locator: no input 'picture'; choose from image, boxes",
        ),
        (
            lambda image, params: None,
            {"inputs": {"image": Image}, "sync": Approximate(0.1)},
            r"Approximate\(slop_s=0.1\) needs several inputs; this node has only: image",
        ),
        (
            lambda image, boxes, params: None,
            {"sync": Exact},
            r"node locator: invalid sync=.*Exact.*; use Each\(\), Exact\(\), Approximate",
        ),
        (
            lambda image, params: None,
            {"inputs": {"image": 3}},
            "node locator: 3 is not a message type; choose from CameraInfo",
        ),
        (
            lambda params, **_: None,
            {"inputs": {"the image": Image}},
            "node locator: the image: invalid name",
        ),
        (
            lambda params: None,
            {"inputs": {"params": Image}},
            "node locator: its step function already has a parameter params; rename the input",
        ),
        (
            type("Empty", (), {"__init__": lambda self, params: None}),
            {},
            r"node locator: the class Empty needs a method step\(self, ",
        ),
        (
            type("Bare", (), {"step": lambda self, params, image=None, boxes=None: None}),
            {},
            "node locator: its __init__ must take params, not nothing",
        ),
        (
            lambda boxes, params: None,
            {"inputs": {"boxes": PoseArray}, "calibrated": True},
            "node locator: calibrated=True needs an input of type Image",
        ),
    ],
)
def test_what_does_not_fit_is_said_when_it_is_declared(step, options, says):
    with pytest.raises(UsageError, match=says):
        declared(step, **options)


@pytest.mark.parametrize("name", ["", "a b", "uav1/locator", "1st", "localisée"])
def test_a_node_has_a_name_that_a_topic_may_have(name):
    with pytest.raises(UsageError, match="invalid name; use letters, digits and _"):
        node(name, inputs={"image": Image}, outputs={"image": Image})

"""The node that tells where the landing target is: when, in which frames, how surely."""

import logging
from dataclasses import replace

import numpy as np
import pytest

from ros_visualise.core.errors import NoTransform, ParameterError
from ros_visualise.core.params import update
from ros_visualise.data import (
    Detection,
    Detections,
    Header,
    Hypothesis,
    Odometry,
    Transforms,
    TransformStamped,
)
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.geometry.rotations import from_matrix, from_rpy
from ros_visualise.nodes.landing_target import LandingTarget, LandingTargetParams

PARAMS = LandingTargetParams(attitude_sigma=0.0)
DOWN = from_matrix(np.diag([1.0, -1.0, -1.0]))
LEVEL = np.array([0.0, 0, 0, 1])
S = 1_000_000_000


@pytest.mark.parametrize("target", ["", " , "])
def test_a_target_without_a_name_is_refused_in_one_line(target):
    with pytest.raises(ParameterError, match="give a landing target"):
        update(PARAMS, {"target": target})


def moving(frame, child, place, turn, times=range(0, 61, 2)):
    return [
        TransformStamped(child, np.array(place, float), turn, Header(t * S // 10, frame))
        for t in times
    ]


def frames(height=5.0):
    """A level body over the origin, with a camera that looks down from 0.1 m ahead of it."""
    tree = FrameTree()
    for one in moving("odom", "base_link", (0, 0, height), LEVEL):
        tree.add(one)
    tree.add(Transforms(tuple(moving("base_link", "camera", (0.1, 0, 0), DOWN, [0]))), static=True)
    return tree


def pad(*place, name="pad", sigma=0.02, camera=(0.1, 0.0, 5.0)):
    x, y, z = np.array(place) - camera
    covariance = np.diag([sigma**2] * 3 + [1e-4] * 3)
    found = Hypothesis(name, 1.0, np.array([x, -y, -z]), DOWN, covariance)
    return Detection(np.zeros(2), np.zeros(2), hypotheses=(found,))


def seen(time_s, *found):
    return Detections(found, Header(round(time_s * S), "camera"))


def odom(time_s):
    return Odometry(np.zeros(3), LEVEL, header=Header(round(time_s * S), "odom"))


def test_it_tells_where_the_target_is_from_the_body_at_the_time_of_the_image():
    answer = LandingTarget(PARAMS).step(PARAMS, seen(1, pad(2, 1, 0)), frames=frames())
    told = answer["landing_target"]
    assert told.header == Header(S, "base_link")
    assert told.position_xyz == pytest.approx([2, 1, -5])
    assert told.quat_xyzw == pytest.approx(LEVEL)
    assert np.sqrt(np.diag(told.covariance)) == pytest.approx([0.02] * 3 + [0.01] * 3, rel=1e-2)
    pose = answer["landing_target_pose"]
    assert np.array_equal(pose.position_xyz, told.position_xyz)
    track = answer["landing_target_odom"]
    assert (track.header.frame_id, track.child_frame_id) == ("odom", "landing_target")
    assert track.position_xyz == pytest.approx([2, 1, 0])


@pytest.mark.parametrize(
    ("autopilot", "frame", "place", "turn"),
    [
        ("ardupilot", "base_link_frd", (2, -1, 5), LEVEL),
        ("px4", "odom_ned", (1, 2, 0), from_rpy([0, 0, np.pi / 2])),
    ],
)
def test_autopilots_are_told_in_the_frame_that_they_take(autopilot, frame, place, turn):
    """A pad 2 m east and 1 m north of a body over the origin that heads east, 5 m below it."""
    params = update(PARAMS, {"autopilot": autopilot})
    answer = LandingTarget(params).step(params, seen(1, pad(2, 1, 0)), frames=frames())
    told = answer["landing_target"]
    assert told.header.frame_id == frame
    assert told.position_xyz == pytest.approx(place)
    assert told.quat_xyzw == pytest.approx(turn)
    assert answer["landing_target_pose"].header == told.header


def test_a_wrong_first_sighting_of_a_still_pad_is_replaced_and_that_is_said(caplog):
    params = replace(PARAMS, speed=0.0, timeout=10.0)
    node, tree = LandingTarget(params), frames()
    with caplog.at_level(logging.WARNING):
        node.step(params, seen(1, pad(1, 0, 0)), frames=tree)
        for step in range(1, 100):
            answer = node.step(params, seen(1 + step / 40, pad(0, 0, 0)), frames=tree)
    assert answer["landing_target"].position_xyz == pytest.approx([0, 0, -5], abs=0.01)
    assert [r.message for r in caplog.records] == [
        "landing_target: estimate of pad replaced, because sightings contradict it"
        " (further occurrences suppressed)"
    ]
    assert node.report() == {"answers": 100, "refused": 5, "replaced": 1, "losses": 0}


def test_between_images_it_tells_at_its_rate_and_is_less_sure_each_time():
    node = LandingTarget(PARAMS)
    told = [node.step(PARAMS, seen(1, pad(0, 0, 0)), frames=frames())]
    told += [node.step(PARAMS, odom=odom(1 + step / 50), frames=frames()) for step in range(1, 46)]
    told = [one["landing_target"] for one in told if one]
    gaps = np.diff([one.header.stamp_ns for one in told]) / 1e9
    assert len(told) > 14
    assert gaps == pytest.approx(0.06)  # of the odometry's 0.02 s, the first after 0.05 s
    variances = [one.covariance[0, 0] for one in told]
    assert variances == sorted(variances)


def test_a_lost_target_is_not_published_and_only_the_first_loss_is_logged(caplog):
    node = LandingTarget(PARAMS)
    node.step(PARAMS, seen(1, pad(0, 0, 0)), frames=frames())
    with caplog.at_level(logging.WARNING):
        answers = [node.step(PARAMS, seen(t), frames=frames()) for t in (1.5, 2.0, 2.1, 2.2)]
    assert [answer is not None for answer in answers] == [True, True, False, False]
    assert node.report() == {"answers": 3, "refused": 0, "replaced": 0, "losses": 1}
    again = node.step(PARAMS, seen(3, pad(3, 3, 0)), frames=frames())
    assert again["landing_target"].position_xyz == pytest.approx([3, 3, -5])
    with caplog.at_level(logging.WARNING):
        assert node.step(PARAMS, seen(5), frames=frames()) is None
    assert node.report()["losses"] == 2
    assert [r.message for r in caplog.records] == [
        "landing_target: pad is lost: not seen for 1 s (further occurrences suppressed)"
    ]


def test_nothing_else_is_a_target_but_what_is_named():
    node = LandingTarget(PARAMS)
    assert node.step(PARAMS, seen(1, pad(0, 0, 0, name="tag36h11_3")), frames=frames()) is None
    params = replace(PARAMS, target="helipad, tag36h11_3")
    assert node.step(params, seen(1, pad(0, 0, 0, name="tag36h11_3")), frames=frames())


def test_a_pad_that_two_detectors_see_is_surer():
    node, one = LandingTarget(PARAMS), replace(PARAMS, target="pad, helipad")
    first = node.step(one, seen(1, pad(0, 0, 0)), frames=frames())["landing_target"]
    both = node.step(one, objects=seen(1, pad(0, 0, 0, name="helipad")), frames=frames())
    ratio = both["landing_target"].covariance[0, 0] / first.covariance[0, 0]
    assert ratio == pytest.approx(0.5, rel=0.01)


def test_after_a_jump_of_time_it_begins_anew():
    node = LandingTarget(PARAMS)
    node.step(PARAMS, seen(5, pad(0, 0, 0)), frames=frames())
    node.reset()
    assert node.step(PARAMS, odom=odom(1), frames=frames()) is None


def test_without_frames_it_cannot_tell():
    with pytest.raises(NoTransform):
        LandingTarget(PARAMS).step(PARAMS, seen(1, pad(0, 0, 0)), frames=FrameTree())


@pytest.mark.parametrize(("name", "value"), [("autopilot", "up"), ("timeout", 0), ("speed", -1)])
def test_wrong_parameters_are_refused(name, value):
    with pytest.raises(ParameterError, match=name):
        update(PARAMS, {name: value})

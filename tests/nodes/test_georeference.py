"""The node that places detections on the Earth: origins, lenses, rejections, and what it says."""

import json
import logging
import math

import numpy as np
import pytest

from ros_visualise.core.errors import NoTransform, OpenError, ParameterError
from ros_visualise.data import (
    CameraInfo,
    Detection,
    Detections,
    Header,
    Hypothesis,
    NavSatFix,
    Transforms,
    TransformStamped,
)
from ros_visualise.geometry import rotations
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.geometry.geodesy import LocalPlane
from ros_visualise.nodes.georeference import Georeference, GeoreferenceParams
from ros_visualise.sources.camera_poses import angle_quats, optical_quats
from ros_visualise.vision.lens_table import lens_of_angle

PARAMS = GeoreferenceParams()
ORIGIN = NavSatFix(47.5, 8.25, 400.0, np.diag([0.0, 0, 0]), 2, header=Header(0, "map"))
PLANE = LocalPlane(47.5, 8.25, 400.0)
LENS = lens_of_angle(90, (640, 480))
S = 1_000_000_000


def tree(pitch=-90, height=40.0, fixed="map", frame="camera", at=(0.0, 0.0)):
    frames = FrameTree()
    quat = optical_quats(angle_quats([[0, pitch, 0]]))[0]
    mounted = TransformStamped(frame, np.array([*at, height]), quat, Header(0, fixed))
    frames.add(Transforms((mounted,)), static=True)
    return frames


def seen(*found, stamp_s=1, info=None, size=(640, 480)):
    return Detections(tuple(found), Header(stamp_s * S, "camera"), info, size)


def box(u=319.5, v=239.5, name="car", size=(20.0, 10.0), **rest):
    return Detection(np.array([u, v]), np.array(size), hypotheses=(Hypothesis(name, 0.9),), **rest)


def started(origin=ORIGIN, lens=LENS, params=PARAMS):
    node = Georeference(params)
    for port, message in {"map_origin": origin, "lens": lens}.items():
        if message is not None:
            node.step(params, **{port: message}, frames=tree())
    return node


def test_a_detection_gets_latitude_longitude_height_and_covariance():
    node = started()
    answer = node.step(PARAMS, objects=seen(box(u=639.5, size=(0.0, 0.0))), frames=tree())
    (thing,) = answer["positions"].detections
    assert answer["positions"].header == Header(S, "map")
    np.testing.assert_allclose(thing.position_xyz, [40, 0, 0], atol=0.2)
    assert 0 < thing.hypotheses[0].covariance[0, 0] < 40
    (point, _) = json.loads(answer["geojson"].text)["features"]
    (expected,) = PLANE.from_enu([thing.position_xyz])
    np.testing.assert_allclose(point["geometry"]["coordinates"], expected[[1, 0, 2]], atol=1e-3)
    assert point["properties"]["class"] == "car"
    assert node.report() == {"placed": 1, "rejected": {}}


def test_a_gimbal_that_is_on_tf_aims_the_camera():
    frames = FrameTree()
    for parent, child, z, pitch in (
        ("map", "base_link", 40.0, 0),
        ("base_link", "gimbal", 0.0, 90),
    ):
        quat = rotations.from_rpy([0, math.radians(pitch), 0])
        one = TransformStamped(child, np.array([0, 0, z]), quat, Header(0, parent))
        frames.add(Transforms((one,)), static=True)
    node = Georeference(PARAMS)
    for port, message in {"map_origin": ORIGIN, "lens": LENS}.items():
        node.step(PARAMS, **{port: message}, frames=frames)
    (thing,) = node.step(PARAMS, objects=seen(box()), frames=frames)["positions"].detections
    np.testing.assert_allclose(thing.position_xyz, [0, 0, 0], atol=0.2)


def test_a_camera_without_attitude_is_taken_to_look_along_its_course():
    """It flies east at 2 m/s, 40 m high; the image is taken 0.5 s after the last fix."""

    def spread(params, moves=True):
        node = Georeference(params)
        node.step(params, map_origin=ORIGIN, frames=FrameTree())
        node.step(params, lens=LENS, frames=FrameTree())
        for second in range(5):
            latitude, longitude, height = PLANE.from_enu([2.0 * second * moves, 0, 40])
            fix = NavSatFix(latitude, longitude, height, header=Header(second * S, "camera"))
            node.step(params, fix=fix, frames=FrameTree())
        stamp = Header(4 * S + S // 2, "camera")
        found = Detections((box(v=79.5, size=(0.0, 0.0)),), stamp, None, (640, 480))
        answer = node.step(params, objects=found, frames=FrameTree())
        (thing,) = answer["positions"].detections if answer else (None,)
        return thing, node.report()["rejected"]

    nadir = GeoreferenceParams(course=True)
    thing, _ = spread(nadir)
    variance = math.radians(30) ** 2  # of the heading
    cos, sine = math.exp(-variance / 2), math.sqrt((1 - math.exp(-2 * variance)) / 2)
    np.testing.assert_allclose(thing.position_xyz, [9 + 20 * cos, 0, 0], atol=0.6)
    east, north, _ = np.sqrt(np.diag(thing.hypotheses[0].covariance)[:3])
    assert north == pytest.approx(math.hypot(20 * sine, 40 * math.radians(5), 3), rel=0.03)
    assert east < north
    ahead, _ = spread(GeoreferenceParams(course=True, camera_pitch=60))
    assert ahead.position_xyz[0] > thing.position_xyz[0] + 15
    assert spread(nadir, moves=False) == (None, {"no course": 1})
    with pytest.raises(NoTransform):
        spread(PARAMS)


def test_boxes_stand_on_their_lower_edge_when_seen_from_the_side():
    """From above they lie at their centre; a point of their own always counts."""
    tall = box(size=(20.0, 100.0))
    foot = box(v=289.5, size=(0.0, 0.0))
    several = seen(tall, foot, box(point_uv=np.array([319.5, 289.5])))
    for pitch, is_at_foot in ((-30, True), (-90, False)):
        answer = started().step(PARAMS, detections=several, frames=tree(pitch))
        a, b, c = (one.position_xyz[1] for one in answer["positions"].detections)
        assert b == pytest.approx(c, abs=0.3)
        assert (abs(a - b) < 3) == is_at_foot


def test_a_lens_that_is_not_calibrated_is_less_certain():
    K = np.array([[320.0, 0, 319.5], [0, 320, 239.5], [0, 0, 1]])
    exact = CameraInfo(480, 640, K)
    params = GeoreferenceParams(lens="90")
    found = [
        started(lens=None, params=params).step(params, detections=one, frames=tree())
        for one in (seen(box(u=639.5), info=exact), seen(box(u=639.5)))
    ]
    known, nominal = (one["positions"].detections[0] for one in found)
    np.testing.assert_allclose(known.position_xyz, nominal.position_xyz, atol=0.1)
    more = nominal.hypotheses[0].covariance - known.hypotheses[0].covariance
    assert more[0, 0] == pytest.approx((0.05 * 40) ** 2, rel=0.1)


def test_images_of_another_size_than_the_lens_are_scaled():
    several = seen(box(u=1279.5, v=479.5, size=(0.0, 0.0)), size=(1280, 960))
    answer = started().step(PARAMS, detections=several, frames=tree())
    np.testing.assert_allclose(answer["positions"].detections[0].position_xyz[0], 40, atol=0.2)


def test_without_an_origin_it_is_found_by_fixes():
    """Errors of fixes do not average out, and a map that is not aligned makes it less certain."""
    node, rng = started(origin=None), np.random.default_rng(1)
    for number in range(20):
        place = PLANE.from_enu(rng.normal([number, 0, 40.0], 0.1))
        fix = NavSatFix(*place, 4 * np.eye(3), 2, header=Header(number * S, "gps"))
        node.step(PARAMS, fix=fix, frames=tree(frame="gps", at=(number, 0.0)))
    answer = node.step(PARAMS, detections=seen(box()), frames=tree())
    origin = answer["map_origin"]
    np.testing.assert_allclose(
        PLANE.to_enu([origin.latitude, origin.longitude, origin.altitude]), 0, atol=0.15
    )
    np.testing.assert_allclose(np.diag(origin.covariance), 4, rtol=1e-6)
    for number in range(100):
        place = PLANE.from_enu([0, number, 40.0])
        fix = NavSatFix(*place, 4 * np.eye(3), 2, header=Header((20 + number) * S, "gps"))
        node.step(PARAMS, fix=fix, frames=tree(frame="gps", at=(number, 0.0)))
    answer = node.step(PARAMS, detections=seen(box()), frames=tree())
    assert answer["map_origin"].covariance[0, 0] > 400


def test_what_cannot_be_placed_is_counted_and_said_once(caplog):
    no_ground = NavSatFix(47.5, 8.25, 400.0, np.diag([0.0, 0, 1e8]), 2, header=Header(0, "map"))
    for node, frames, reason in (
        (started(), tree(pitch=10), "above the horizon"),
        (started(), tree(pitch=-3), "too close to the horizon"),
        (started(), tree(height=-1), "the camera is not above the ground"),
        (started(lens=None), tree(), "no lens"),
        (started(origin=None), tree(), "no position yet"),
        (started(origin=no_ground), tree(), "the height above the ground is unknown"),
    ):
        caplog.clear()
        for _ in range(3):
            answer = node.step(PARAMS, detections=seen(box()), frames=frames)
            assert answer is None or answer["positions"].detections == ()
        assert node.report() == {"placed": 0, "rejected": {reason: 3}}
        (said,) = [one for one in caplog.records if one.levelno == logging.WARNING]
        assert reason in said.message
    with pytest.raises(NoTransform):
        started().step(PARAMS, detections=seen(box()), frames=FrameTree())
    with pytest.raises(ParameterError, match="field of view in degrees"):
        GeoreferenceParams(lens="no such camera")
    with pytest.raises(OpenError, match=r"none\.tif: No such file"):
        Georeference(GeoreferenceParams(terrain="none.tif"))


def test_errors_of_time_count_with_the_speed_of_the_camera():
    frames = FrameTree()
    for number in range(30):
        at, quat = np.array([number * 1.0, 0, 40]), optical_quats(angle_quats([[0, -90, 0]]))[0]
        one = TransformStamped("camera", at, quat, Header(number * S // 10, "map"))
        frames.add(Transforms((one,)))
    slow, late = GeoreferenceParams(), GeoreferenceParams(time_sigma=0.5)
    a, b = (
        started(params=one).step(one, detections=seen(box()), frames=frames)["positions"]
        for one in (slow, late)
    )
    more = b.detections[0].hypotheses[0].covariance - a.detections[0].hypotheses[0].covariance
    np.testing.assert_allclose(np.diag(more)[:3], [25, 0, 0], atol=0.1)  # 0.5 s at 10 m/s

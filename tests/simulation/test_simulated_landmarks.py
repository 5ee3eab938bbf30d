"""Tags of a simulated flight are found and located, as surely as the localizer says."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from simulated_runs import collect

from ros_visualise.data import Detection, Detections, Hypothesis
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.geometry.rotations import to_matrix
from ros_visualise.geometry.se3 import turn_between
from ros_visualise.landmarks.pose import square_poses
from ros_visualise.landmarks.tags import TagFinder, parse_families
from ros_visualise.nodes.landmark_localizer import LandmarkLocalizer, LocalizerParams
from ros_visualise.simulation.robots.quadrotor.settings import QuadrotorParams
from ros_visualise.simulation.simulator import Simulation

MOST = 16.81  # squared distances of 6 numbers: 99 of 100 are below


def detected(image, sizes):
    """Its tags as a detector gives them, of known sizes."""
    finder = TagFinder(parse_families("tag36h11"))
    found = []
    for tag in finder.find(cv2.cvtColor(image.pixels, cv2.COLOR_RGB2GRAY)):
        poses = square_poses(tag.corners_uv, sizes[tag.id], image.camera_info)
        hypotheses = [
            Hypothesis(tag.name, p.probability, p.position_xyz, p.quat_xyzw, p.covariance, tag.id)
            for p in poses
        ]
        found.append(Detection.of_corners(tag.corners_uv, hypotheses, str(tag.id)))
    return Detections(tuple(found), image.header, image.camera_info)


@pytest.fixture(scope="module")
def flight(opengl):
    """The quadrotor's own mission, and what its sensors tell over two tags."""
    begun = []
    settings = replace(QuadrotorParams(), camera_rate=2.0, gps=False)
    simulation = Simulation(
        "quadrotor", "field", 0, "default", settings, lambda o: o != "image" or bool(begun)
    )
    found = collect(simulation, 13)
    begun.append(True)
    later = collect(simulation, 8)
    return simulation, {name: found.get(name, []) + later.get(name, []) for name in later | found}


def test_tags_are_where_they_are_by_odometry_that_drifts_and_says_so(flight):
    simulation, found = flight
    truth = {one.tag_id: one for one in simulation.world.landmarks if one.kind == "tag"}
    frames, params = FrameTree(history_s=60), LocalizerParams(min_sightings=2)
    for name in ("tf_static", "tf"):
        for message in found[name]:
            frames.add(message, static=name == "tf_static")
    node, odoms = LandmarkLocalizer(params), iter(found["odom"])
    odom, answer = next(odoms), {}
    for image in found["image"]:
        while odom.header.stamp_ns < image.header.stamp_ns:
            node.step(params, odom=odom, frames=frames)
            odom = next(odoms)
        seen = detected(image, {number: one.size for number, one in truth.items()})
        answer |= node.step(params, detections=seen, frames=frames)
    located = answer["landmarks"].detections
    assert len(located) == len(answer["tf_static"].transforms) >= 2
    for one in located:
        landmark = truth[one.hypotheses[0].number]
        off = one.position_xyz - landmark.position_xyz
        turned = turn_between(to_matrix(one.quat_xyzw), landmark.R_map_landmark)
        error, covariance = np.concatenate([off, turned]), one.hypotheses[0].covariance
        assert np.linalg.norm(off) < 0.5
        assert error @ np.linalg.solve(covariance, error) < MOST
        np.testing.assert_allclose(one.size_xyz, [landmark.size, landmark.size, 0], rtol=0.03)

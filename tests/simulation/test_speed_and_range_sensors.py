"""Rangefinder, optical flow and wheel speed, against the true motion that is published."""

import math
from dataclasses import replace

import numpy as np
import pytest
from simulated_runs import BLIND_HUSKY, BLIND_QUADROTOR, collect, twist

from ros_visualise.geometry import rotations
from ros_visualise.simulation.missions import Mission
from ros_visualise.simulation.sensors.optical_flow import OpticalFlow
from ros_visualise.simulation.sensors.rangefinder import Rangefinder
from ros_visualise.simulation.sensors.wheel_speed import WheelSpeed
from ros_visualise.simulation.simulator import Simulation

EXACT = replace(BLIND_QUADROTOR, range_noise=0.0, range_scale=0.0, flow_noise=0.0, flow_scale=0.0)
SQUARE = Mission("square", size=(6.0, 6.0), height=3.0, speed=2.0)


def flight(settings, seconds=12.0):
    simulation = Simulation("quadrotor", "plane", 4, SQUARE, settings)
    found = collect(simulation, seconds)
    truth = {m.header.stamp_ns: m for m in found["truth"]}
    frames = {t.child_frame_id: t for t in found["tf_static"][0].transforms}
    return found, truth, frames


def test_the_range_is_the_distance_along_its_beam_to_the_ground():
    found, truth, frames = flight(EXACT)
    mounted = frames["range_link"]
    met = 0
    for message in found["range"]:
        pose = truth.get(message.header.stamp_ns)
        if pose is None or not math.isfinite(message.range):
            continue
        R = rotations.to_matrix(pose.quat_xyzw)
        start = pose.position_xyz + R @ mounted.translation_xyz
        beam = R @ rotations.to_matrix(mounted.quat_xyzw) @ [1.0, 0, 0]
        assert message.range == pytest.approx(-start[2] / beam[2], abs=1e-6)
        met += 1
    assert met > 100
    assert message.header.frame_id == "range_link"


def test_a_range_out_of_its_limits_is_infinite():
    found, _, _ = flight(replace(EXACT, range_near=0.5, range_far=2.0))
    distances = [m.range for m in found["range"]]
    assert -math.inf in distances  # on the ground
    assert math.inf in distances  # at 3 m
    assert all(0.5 <= d <= 2 for d in distances if math.isfinite(d))


def test_the_range_meets_a_pad_below_it():
    settings = replace(EXACT, pad=True, pad_x=-3.5, pad_y=1.5)
    above = Mission(waypoints=((-3.5, 1.5, 2.0),), land=False)
    found = collect(Simulation("quadrotor", "plane", 0, above, settings), 15.0)
    height = found["truth"][-1].position_xyz[2] - 0.05
    assert found["range"][-1].range == pytest.approx(
        height - found["pad"][-1].position_xyz[2], abs=0.02
    )


def test_optical_flow_is_the_velocity_of_its_place_over_the_ground():
    found, _, frames = flight(EXACT)
    lever = frames["flow_link"].translation_xyz
    stamps = np.array([m.header.stamp_ns for m in found["truth"]]) / 1e9
    R = np.array([rotations.to_matrix(m.quat_xyzw) for m in found["truth"]])
    places = np.array([m.position_xyz for m in found["truth"]]) + R @ lever
    over_ground = np.gradient(places, stamps, axis=0)
    errors = []
    for message in found["optical_flow"]:
        at = np.searchsorted(stamps, message.header.stamp_ns / 1e9 - 1e-9)
        if 2 < at < len(stamps) - 2:
            errors.append(message.linear_xyz[:2] - (R[at].T @ over_ground[at])[:2])
    assert len(errors) > 100
    assert np.abs(errors).max() < 0.1
    assert np.std(errors) < 0.02
    assert message.header.frame_id == "flow_link"


def test_optical_flow_sees_nothing_when_far_from_the_ground():
    low, _, _ = flight(EXACT)
    high, _, _ = flight(replace(EXACT, flow_far=1.5))
    assert 10 < len(high["optical_flow"]) < 0.5 * len(low["optical_flow"])


def test_the_wheels_measure_the_speed_of_the_rover():
    settings = replace(BLIND_HUSKY, wheel_speed=True, wheel_noise=0.0, wheel_scale=0.0)
    simulation = Simulation("husky", "plane", settings=settings)
    for _ in range(12):
        simulation.command(twist(x=0.7))
        found = collect(simulation, 0.4)
    assert found["wheel_speed"][-1].linear_xyz == pytest.approx([0.7, 0, 0], abs=0.02)
    assert "wheel_speed" not in collect(Simulation("husky", "plane", settings=BLIND_HUSKY), 0.5)


def test_the_errors_have_the_published_covariances():
    """Over many runs: the mean squared error, in units of the variance, is 1."""
    true_m, true_m_s = 6.0, np.array([3.0, -1.0, 0.2])
    ranges, flows, wheels = [], [], []
    for seed in range(600):
        found = Rangefinder(BLIND_QUADROTOR, seed).measure(0, true_m)
        ranges.append((found.range - true_m) ** 2 / found.variance)
        flow = OpticalFlow(BLIND_QUADROTOR, seed).measure(0, true_m_s, true_m)
        off = (flow.linear_xyz - true_m_s)[:2]
        flows.append(off @ np.linalg.solve(flow.covariance[:2, :2], off) / 2)
        wheel = WheelSpeed(BLIND_HUSKY, seed).measure(0, 2.0)
        wheels.append((wheel.linear_xyz[0] - 2.0) ** 2 / wheel.covariance[0, 0])
    for errors in (ranges, flows, wheels):
        assert np.mean(errors) == pytest.approx(1.0, abs=0.2)
    assert flow.covariance[2, 2] >= 1e6  # not measured

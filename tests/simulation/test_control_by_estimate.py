"""Missions steered by the pose that a navigator publishes: robots go where it says."""

import json
import math
import sys
from dataclasses import replace

import forked
import numpy as np
import pytest
from simulated_runs import BLIND_HUSKY, BLIND_QUADROTOR

from ros_visualise.core.errors import UsageError
from ros_visualise.data import Header, PoseWithCovarianceStamped
from ros_visualise.geometry.rotations import from_rpy, multiply
from ros_visualise.simulation.estimated_state import ControlPose
from ros_visualise.simulation.missions import Mission
from ros_visualise.simulation.simulator import Simulation

SETTINGS = {
    "husky": replace(BLIND_HUSKY, control=ControlPose.ESTIMATE),
    "quadrotor": replace(BLIND_QUADROTOR, control=ControlPose.ESTIMATE),
}
AWAY = Mission(waypoints=((5.0, 2.0, 3.0),), land=False, speed=1.5)


def run(robot, estimate, mission=AWAY, seconds=60.0, **changes):
    """A run whose navigator publishes ``estimate(truth)``; status texts, and the last truth."""
    simulation = Simulation(robot, "plane", 2, mission, replace(SETTINGS[robot], **changes))
    texts, truths = [], []
    for time_ns, name, message in simulation.run():
        if name == "status":
            texts.append(message.text)
        if name == "truth":
            truths.append(message)
            pose = estimate(message)
            if pose is not None:
                simulation.localize(pose)
            if simulation.finished or time_ns > seconds * 1e9:
                break
    return simulation, texts, truths


def as_pose(truth, shift=(0.0, 0.0, 0.0), turn=0.0, frame="map"):
    quat = multiply(from_rpy([0, 0, turn]), truth.quat_xyzw)
    header = Header(truth.header.stamp_ns, frame)
    return PoseWithCovarianceStamped(truth.position_xyz + shift, quat, np.eye(6) * 1e-4, header)


@pytest.mark.parametrize("robot", ["husky", "quadrotor"])
def test_it_goes_where_the_estimate_says_not_where_it_truly_is(robot):
    shift = np.array([1.0, -0.5, 0.0])
    for moved in (np.zeros(3), shift):
        simulation, _, truths = run(robot, lambda truth, by=moved: as_pose(truth, by))
        assert simulation.finished
        assert not simulation.failure
        end = truths[-1].position_xyz
        assert math.dist(end[:2], np.array([5.0, 2.0]) - moved[:2]) < 0.35


def test_an_estimate_in_another_frame_is_rejected():
    simulation = Simulation("husky", "plane", 0, AWAY, SETTINGS["husky"])
    truth = next(m for _, name, m in simulation.run() if name == "truth")
    with pytest.raises(UsageError, match="must be in the frame map, not odom"):
        simulation.localize(as_pose(truth, frame="odom"))
    with pytest.raises(UsageError, match="finite"):
        simulation.localize(as_pose(truth, (math.nan, 0, 0)))


def test_a_rover_without_an_estimate_waits_and_says_why_it_aborts():
    simulation, texts, truths = run("husky", lambda _: None, estimate_patience=5.0)
    assert math.dist(truths[0].position_xyz, truths[-1].position_xyz) < 0.05
    assert "waiting: no pose estimate" in texts
    assert simulation.failure == (
        "husky aborted its mission at (0.0, 0.0): no pose estimate for 5 s"
    )


def test_a_quadrotor_without_an_estimate_rises_holds_and_lands_with_the_reason():
    simulation, texts, truths = run("quadrotor", lambda _: None, estimate_patience=5.0)
    places = np.array([m.position_xyz for m in truths])
    assert places[:, 2].max() == pytest.approx(3.0, abs=0.4)
    assert np.abs(places[:, :2]).max() < 0.5
    assert places[-1, 2] < 0.25  # on the ground
    assert [t for t in texts if "no pose estimate" in t] == [
        "holding: no pose estimate",
        "landing: no pose estimate",
    ]
    assert simulation.failure.endswith("no pose estimate for 5 s")


def test_it_holds_while_the_estimate_pauses_and_goes_on_after():
    def pausing(truth):
        time_s = truth.header.stamp_ns / 1e9
        return None if 6 < time_s < 10 else as_pose(truth)

    simulation, texts, truths = run("quadrotor", pausing)
    assert texts.count("holding: no pose estimate") == 1
    by_time = {m.header.stamp_ns / 1e9: m.position_xyz for m in truths}
    held = [place for time_s, place in by_time.items() if 8.5 < time_s < 10]
    assert math.dist(held[0], held[-1]) < 0.3
    assert simulation.finished
    assert not simulation.failure


def test_a_correction_does_not_jerk_it():
    """A step of 1 m in the estimate: it moves over, within its limits, and does not tip."""

    def stepping(truth):
        return as_pose(truth, (0.0, 1.0 if truth.header.stamp_ns > 15e9 else 0.0, 0.0))

    hover = Mission(waypoints=((0.5, 0.0, 3.0), (60.0, 0.0, 3.0)), land=False, speed=0.2)
    simulation, _, truths = run("quadrotor", stepping, hover, 25.0)
    assert simulation.upright
    tilts = [2 * math.hypot(*m.quat_xyzw[:2]) for m in truths]
    assert max(tilts) < math.radians(30)
    assert truths[-1].position_xyz[1] == pytest.approx(-1.0, abs=0.25)


@pytest.mark.usefixtures("opengl")
def test_by_the_command_line_the_navigator_steers_the_mission():
    command = [sys.executable, "-m", "ros_visualise", "sim", "quadrotor", "--navigate"]
    command += ["--view", "none", "--rate", "0", "--mission", "square", "--duration", "14"]
    done = forked.run([*command, "--set", "quadrotor.control=estimate", "--json"])
    report = json.loads(done.stdout)
    assert done.returncode == 0, done.stderr
    assert report["topics"]["/navigation/pose"]["messages"] > 300
    assert "no pose estimate" not in done.stderr

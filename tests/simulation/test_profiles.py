"""Profiles: one word sets what makes a simulation unkind."""

import json
import sys

import forked
import pytest

from ros_visualise.core.params import specs, update
from ros_visualise.graph.pipelines import simulation_pipeline
from ros_visualise.simulation.profiles import Profile, settings_of
from ros_visualise.simulation.robots.husky.settings import HuskyNodeParams
from ros_visualise.simulation.robots.quadrotor.settings import QuadrotorNodeParams

NODES = (HuskyNodeParams, QuadrotorNodeParams)


def test_a_profile_sets_only_what_robots_have():
    known = {spec.name for params in NODES for spec in specs(params)}
    assert set(settings_of(Profile.HARD)) <= known


@pytest.mark.parametrize("params", NODES)
def test_ideal_are_the_defaults_and_brings_them_back(params):
    assert update(params(), {"profile": "ideal"}) == params()
    assert update(update(params(), {"profile": "hard"}), {"profile": "ideal"}) == params()


def test_hard_is_harder_than_realistic_which_is_harder_than_ideal():
    ideal, realistic, hard = map(settings_of, Profile)
    for name in ideal:
        steps = [abs(one[name]) for one in (ideal, realistic, hard)]
        if name.endswith("_every"):  # a mean time, 0: never
            assert steps[0] == 0 < steps[2] < steps[1], name
        elif not name.endswith("_for") and name != "gps_jump":
            assert steps == sorted(steps), name
            assert steps[2] > steps[0], name


@pytest.mark.usefixtures("opengl")
def test_the_command_line_takes_a_profile_and_changes_to_it():
    command = [sys.executable, "-m", "ros_visualise", "sim", "quadrotor", "--world", "plane"]
    command += ["--profile", "hard", "--view", "none", "--rate", "0", "--duration", "4", "--json"]
    done = forked.run([*command, "--set", "quadrotor.camera_dropped=0.8"])
    topics = json.loads(done.stdout)["topics"]
    assert 2 <= topics["/image_raw"]["messages"] < 20  # of 40
    assert topics["/imu/data"]["messages"] > 390


def test_single_values_replace_those_of_the_profile():
    graph = simulation_pipeline("quadrotor", profile="hard")
    changed = graph.configured({"quadrotor": {"camera_latency": 0.0}}).source.params
    assert (changed.camera_latency, changed.camera_k1) == (0.0, graph.source.params.camera_k1)
    assert changed.camera_k1 == settings_of(Profile.HARD)["camera_k1"]

"""The landing pad: how it moves, what it shows, and what stands on it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from simulated_runs import BLIND_QUADROTOR, collect

from ros_visualise.core.errors import OpenError
from ros_visualise.graph.landmarks import tags_of_world
from ros_visualise.landmarks.tags.known import read_known_tags
from ros_visualise.simulation import worlds
from ros_visualise.simulation.pad import PAD_TAGS, PadMotion
from ros_visualise.simulation.simulator import Simulation
from ros_visualise.simulation.worlds import WORLDS


def with_pad(motion: PadMotion, **settings):
    chosen = replace(BLIND_QUADROTOR, pad=True, pad_motion=motion, **settings)
    return Simulation("quadrotor", "plane", 0, None, chosen)


def test_on_a_line_it_goes_forth_and_back_at_its_speed():
    simulation = with_pad(PadMotion.LINE, pad_heading=90.0, pad_reach=6.0, pad_x=1.0, pad_y=2.0)
    pads = collect(simulation, 17)["pad"]
    ways = np.array([one.position_xyz for one in pads])
    assert np.allclose(ways[:, [0, 2]], [1.0, 0.3])
    assert [ways[0, 1], ways[:, 1].max()] == pytest.approx([2.0, 8.0], abs=1e-3)
    speeds = np.gradient(ways[:, 1], 0.02)
    assert abs(speeds).max() == pytest.approx(1.0, abs=1e-6)
    assert np.allclose(speeds[1:-1], [one.linear_xyz[0] for one in pads[1:-1]], atol=0.01)
    assert ways[800, 1] == pytest.approx(2.0, abs=1e-3)  # after 16 s: there and back


def test_on_a_circle_it_goes_around():
    pads = collect(with_pad(PadMotion.CIRCLE, pad_reach=4.0), 13)["pad"]
    ways = np.array([one.position_xyz[:2] for one in pads])
    assert np.allclose(np.linalg.norm(ways - [-3.5, 3.5], axis=1), 2.0)
    assert np.allclose(np.linalg.norm(np.diff(ways, axis=0), axis=1) / 0.02, 1.0, atol=1e-3)


@pytest.mark.parametrize("world", WORLDS.builtin)
def test_the_file_of_each_world_knows_the_tags_of_the_pad(world):
    tags = Path(tags_of_world(world))
    own = Path(worlds.__file__).with_name(f"{world}_tags.yaml")  # as launch files name it
    assert tags == (own if own.exists() else own.with_name("plane_tags.yaml"))
    (bundle,) = read_known_tags(str(tags)).bundles
    assert bundle.name == "pad"
    for tag_id, size, place in PAD_TAGS:
        corners = bundle.corners_xyz[tag_id]
        assert corners.mean(axis=0) == pytest.approx([*place, 0.0])
        assert corners[1] - corners[0] == pytest.approx([size, 0, 0])


def test_it_carries_along_what_stands_on_it():
    simulation = with_pad(PadMotion.LINE, pad_reach=40.0)
    simulation._data.qpos[:3] = [-3.5, 1.5, 0.5]
    rode = collect(simulation, 9)
    both = zip(rode["truth"], rode["pad"], strict=True)
    apart = np.array([robot.position_xyz - pad.position_xyz for robot, pad in both])
    assert rode["pad"][-1].position_xyz[0] > 4
    assert abs(apart[-1] - [0, 0, 0.16]).max() < 0.03
    assert np.ptp(apart[150:, :2], axis=0).max() < 0.001


def test_a_robot_without_a_pad_has_none():
    alone = Simulation("quadrotor", "plane", 0, None, BLIND_QUADROTOR)
    beside = with_pad(PadMotion.STILL)
    assert alone.pad is None
    assert {*beside.outputs} - {*alone.outputs} == {"pad"}
    first, second = (collect(one, 0.1)["tf_static"][0].transforms for one in (alone, beside))
    assert [one.child_frame_id for one in first] == [one.child_frame_id for one in second]


def test_a_pad_where_the_robot_stands_is_refused():
    beside = replace(BLIND_QUADROTOR, pad=True, pad_x=0.0, pad_y=1.2)
    assert Simulation("quadrotor", "plane", settings=beside).pad is not None
    for changed in ({"pad_y": 0.8}, {"pad_x": -1.6, "pad_y": 0.0}, {"pad_heading": -90.0}):
        with pytest.raises(OpenError, match="choose another pad_x or pad_y"):
            Simulation("quadrotor", "plane", settings=replace(beside, **changed))


def test_a_pad_that_would_run_over_the_robot_before_it_takes_off_is_refused():
    beside = replace(BLIND_QUADROTOR, pad=True, pad_x=-2.4, pad_y=0.0, pad_reach=20.0)
    assert Simulation("quadrotor", "plane", settings=beside).pad is not None
    moving = replace(beside, pad_motion=PadMotion.LINE)
    with pytest.raises(OpenError, match="collides"):
        Simulation("quadrotor", "plane", settings=moving)

"""What robots do that something holds."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from simulated_runs import BLIND_HUSKY, BLIND_QUADROTOR, collect, twist

from ros_visualise.core.errors import UsageError
from ros_visualise.data import PoseStamped
from ros_visualise.simulation.missions import Mission
from ros_visualise.simulation.simulator import Simulation

LASTING = replace(BLIND_QUADROTOR, command_timeout=30.0)


def in_the_air(world: str) -> Simulation:
    simulation = Simulation("quadrotor", world, settings=LASTING)
    simulation.act("take_off")
    collect(simulation, 4.0)
    return simulation


def test_flown_down_to_the_ground_it_lands_and_takes_off_as_soon_as_ever():
    simulation = in_the_air("field")
    simulation.command(twist(z=-1))
    down = collect(simulation, 10.0)["truth"][-1]
    assert down.position_xyz[2] < 0.2
    assert simulation._data.ctrl.max() == 0, "its motors are off"
    simulation.act("take_off")
    assert collect(simulation, 4.0)["truth"][-1].position_xyz[2] > 1.8


def test_flown_at_a_fence_it_comes_back_at_once():
    simulation = Simulation("quadrotor", "playpen", settings=LASTING)
    simulation._data.qpos[:2] = 2.0, 8.0
    simulation.command(twist(z=0.25))
    collect(simulation, 1.5)
    simulation.command(twist(y=0.5))
    place = np.array([m.position_xyz for m in collect(simulation, 25.0)["truth"]])
    assert place[-1, 1] > 9
    assert place[-1, 1] < 10
    assert math.dist(simulation._robot._reference.position, place[-1]) < 0.8
    simulation.command(twist(y=-1.0, z=0.2))
    back = collect(simulation, 3.0)["truth"][-1].position_xyz
    assert back[1] < place[-1, 1] - 1.0


def test_a_mission_waits_and_does_not_begin_once_it_was_stopped():
    settings = replace(BLIND_QUADROTOR, mission_delay=1.0)
    waiting, stopped = (
        Simulation("quadrotor", "plane", mission="default", settings=settings) for _ in range(2)
    )
    heights = [collect(waiting, 0.9)["truth"][-1].position_xyz[2]]
    heights.append(collect(waiting, 2.0)["truth"][-1].position_xyz[2])
    assert heights[0] < 0.2 < 0.5 < heights[1]
    stopped.act("stop")
    assert collect(stopped, 3.0)["truth"][-1].position_xyz[2] < 0.2


def test_a_mission_without_progress_is_given_up_and_can_be_begun_anew():
    mission = Mission(waypoints=((3.0, 0.0, 1.0),))
    settings = replace(BLIND_QUADROTOR, mission_timeout=4.0)
    simulation = Simulation("quadrotor", "plane", mission=mission, settings=settings)
    weights = simulation._model.body_mass.copy()
    simulation._model.body_mass[:] *= 4
    collect(simulation, 3.5)
    assert not simulation.finished
    collect(simulation, 6.0)
    assert simulation.finished
    assert simulation.failure == "quadrotor aborted its mission at (0.0, 0.0): no progress for 4 s"
    simulation._model.body_mass[:] = weights
    simulation.act("start_mission")
    collect(simulation, 1.0)
    assert not simulation.finished
    assert not simulation.failure
    collect(simulation, 14.0)
    assert simulation.finished
    assert not simulation.failure


def test_a_mission_that_turns_and_creeps_gets_on():
    settings = replace(BLIND_HUSKY, mission_timeout=6.0)
    mission = Mission(waypoints=((-0.6, 0.0, 0.0), (0.0, 0.0, 0.0)), speed=0.05)
    simulation = Simulation("husky", "plane", mission=mission, settings=settings)
    collect(simulation, 70.0)
    assert simulation.finished
    assert not simulation.failure


def test_a_mission_that_a_person_ends_does_not_fail():
    way = ((0.0, 0.0, 0.0), (12.0, 0.0, 0.0))
    settings = replace(BLIND_HUSKY, mission_timeout=2.0)
    simulation = Simulation("husky", "plane", mission=Mission(waypoints=way), settings=settings)
    collect(simulation, 1.0)
    simulation.act("stop")
    collect(simulation, 5.0)
    assert not simulation.finished
    assert not simulation.failure


def test_flown_fast_into_a_fence_its_motors_go_off_and_it_flies_again_if_it_stands():
    simulation = Simulation("quadrotor", "playpen", settings=LASTING)
    simulation._data.qpos[:2] = 2.0, 8.5
    simulation.command(twist(z=0.5))
    collect(simulation, 1.3)
    simulation.command(twist(y=2.0))
    collect(simulation, 12.0)
    assert re.fullmatch(r"quadrotor tipped over at \(2\.0, 9\.\d\): motors off", simulation.failure)
    assert simulation._data.ctrl.max() == 0
    assert simulation._data.act.max() < 0.01
    simulation.act("take_off")
    assert collect(simulation, 4.0)["truth"][-1].position_xyz[2] > 1.8


@pytest.mark.parametrize("robot", ["husky", "quadrotor"])
def test_tipped_over_its_mission_fails_and_it_does_nothing_more(robot: str):
    settings = {"husky": BLIND_HUSKY, "quadrotor": LASTING}[robot]
    simulation = Simulation(robot, "plane", mission="square", settings=settings)
    collect(simulation, 1.0)
    simulation._data.qpos[2:7] = 0.4, 0, 1, 0, 0
    collect(simulation, 3.0)
    assert simulation.finished
    assert "(" in simulation.failure
    simulation.command(twist(x=1, z=1))
    for order in ("stop", "start_mission"):
        with pytest.raises(UsageError, match=f"the {robot} has tipped over; reset it"):
            simulation.act(order)
    with pytest.raises(UsageError, match="reset it"):
        simulation.add_mission("square")
    with pytest.raises(UsageError, match="reset it"):
        simulation.goto(PoseStamped(np.ones(3), np.array([0, 0, 0, 1.0])))
    place = np.array([m.position_xyz for m in collect(simulation, 3.0)["truth"]])
    assert place[-1] == pytest.approx(place[-25], abs=0.01)
    assert np.abs(simulation._data.qvel[6:]).max(initial=0) < 0.1, "its wheels stand"


def test_a_rover_that_makes_no_way_says_so_once_where_it_is(caplog):
    held = replace(BLIND_HUSKY, command_timeout=30.0)
    simulation = Simulation("husky", "playpen", settings=held)
    simulation.command(twist(turn=0.5))
    collect(simulation, 6.0)
    simulation.command(twist(x=0.02))
    collect(simulation, 6.0)
    simulation.act("stop")
    collect(simulation, 1.0)
    assert not caplog.messages, "it turned, and crept"
    simulation._data.qpos[:7] = 9.2, 4.5, 0.132, 1, 0, 0, 0
    simulation.command(twist(x=0.5))
    collect(simulation, 15.0)
    assert caplog.messages == ["husky is stuck at (9.4, 4.5): something blocks it"]

"""What robots do that something holds."""

import logging
import math
from dataclasses import replace

import numpy as np
from simulated_runs import BLIND_HUSKY, BLIND_QUADROTOR, collect, twist

from ros_visualise.simulation import Mission, Simulation

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
    place = np.array([m.position_xyz for m in collect(simulation, 10.0)["truth"]])
    assert place[-1, 1] > 9
    assert place[-1, 1] < 10
    assert math.dist(simulation._robot._point, place[-1]) < 1.2
    simulation.command(twist(y=-1.0, z=0.2))
    back = collect(simulation, 3.0)["truth"][-1].position_xyz
    assert back[1] < place[-1, 1] - 1.0


def test_a_mission_through_a_fence_is_not_finished(caplog):
    way = ((0.0, 1.5, 0.5), (12.0, 1.5, 0.5), (0.0, 1.5, 0.5))
    mission = Mission(waypoints=way)
    simulation = Simulation("quadrotor", "playpen", mission=mission, settings=BLIND_QUADROTOR)
    with caplog.at_level(logging.WARNING, "ros_visualise"):
        place = np.array([m.position_xyz for m in collect(simulation, 60.0)["truth"]])
    assert 9 < place[-1, 0] < 10
    assert not simulation.finished
    assert len(caplog.messages) == 1
    assert caplog.messages[0].startswith("quadrotor makes no way at (")
    assert caplog.messages[0].endswith("): something is in its way")


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
    assert caplog.messages == ["husky makes no way at (9.4, 4.5): something is in its way"]

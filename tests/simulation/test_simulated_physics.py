"""The robots move as their physics and their data sheets have it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from simulated_runs import BLIND_HUSKY, BLIND_QUADROTOR, collect, twist

from ros_visualise.core.errors import UsageError
from ros_visualise.data import Header, PoseStamped
from ros_visualise.simulation.missions import Mission
from ros_visualise.simulation.settings import RobotParams
from ros_visualise.simulation.simulator import Simulation
from ros_visualise.simulation.worlds import WORLDS


def test_a_quadrotor_without_thrust_falls_freely():
    simulation = Simulation("quadrotor", "plane", settings=BLIND_QUADROTOR)
    simulation._data.qpos[2] = 30.0
    found = collect(simulation, 0.4)
    last = found["truth"][-1]
    time_s = last.header.stamp_ns / 1e9
    assert last.position_xyz[2] == pytest.approx(30 - 9.81 / 2 * time_s**2, abs=0.01)
    assert last.linear_xyz[2] == pytest.approx(-9.81 * time_s, rel=0.02)
    force = np.linalg.norm([m.linear_xyz for m in found["imu"]], axis=1)
    assert force.mean() < 0.4, "what falls freely feels nothing but the air"


def test_hovering_takes_the_thrust_of_its_weight():
    simulation = Simulation("quadrotor", "plane", settings=BLIND_QUADROTOR)
    simulation.act("take_off")
    last = collect(simulation, 8.0)["truth"][-1]
    assert simulation._data.act.sum() == pytest.approx(1.5 * 9.81, rel=1e-3)
    assert last.position_xyz == pytest.approx([0, 0, 2.0], abs=0.02)
    assert last.linear_xyz == pytest.approx([0, 0, 0], abs=0.02)


def test_the_quadrotor_takes_off_mows_its_rows_and_lands_where_it_took_off():
    mission = Mission("lawn_mower", size=(6.0, 3.0), height=3.0, speed=2.0)
    simulation = Simulation("quadrotor", "plane", settings=BLIND_QUADROTOR)
    simulation._data.qpos[:2] = -2.0, 1.0
    collect(simulation, 0.1)
    simulation.add_mission(mission)
    place = np.array([m.position_xyz for m in collect(simulation, 40.0)["truth"]])
    assert simulation.finished
    assert place[:, 2].max() == pytest.approx(3.0, abs=0.15)
    for corner in mission.route().points:
        assert np.linalg.norm(place - corner, axis=1).min() < 1.0
    assert place[-1] == pytest.approx([-2, 1, 0.16], abs=0.15)
    assert simulation._data.ctrl.max() == 0, "its motors are off"


def test_a_velocity_is_flown_and_forgotten_after_its_timeout():
    simulation = Simulation("quadrotor", "plane", settings=BLIND_QUADROTOR)
    simulation.act("take_off")
    collect(simulation, 5.0)
    for _ in range(10):
        simulation.command(twist(x=1.5, turn=0.4))
        moving = collect(simulation, 0.3)["truth"][-1]
    assert np.hypot(*moving.linear_xyz[:2]) == pytest.approx(1.5, abs=0.15)
    assert moving.angular_xyz[2] == pytest.approx(0.4, abs=0.05)
    still = collect(simulation, 3.0)["truth"][-1]
    assert still.linear_xyz == pytest.approx([0, 0, 0], abs=0.05)


def test_a_way_point_is_flown_to():
    simulation = Simulation("quadrotor", "plane", settings=BLIND_QUADROTOR)
    quarter = np.array([0, 0, math.sin(math.pi / 4), math.cos(math.pi / 4)])
    simulation.goto(PoseStamped(np.array([3.0, -2.0, 4.0]), quarter))
    last = collect(simulation, 12.0)["truth"][-1]
    assert last.position_xyz == pytest.approx([3, -2, 4], abs=0.05)
    assert abs(last.quat_xyzw @ quarter) == pytest.approx(1, abs=1e-3)
    with pytest.raises(UsageError, match="map"):
        simulation.goto(PoseStamped(np.zeros(3), quarter, Header(0, "base_link")))


def test_to_a_goal_on_the_ground_plane_it_flies_as_high_as_it_is():
    simulation = Simulation("quadrotor", "plane", settings=BLIND_QUADROTOR)
    ahead = np.array([0, 0, 0, 1.0])
    simulation.goto(PoseStamped(np.array([2.0, 0.0, 0.0]), ahead))
    from_ground = collect(simulation, 9.0)["truth"][-1]
    assert from_ground.position_xyz == pytest.approx([2, 0, 2.0], abs=0.05)
    simulation.goto(PoseStamped(np.array([2.0, 0.0, 3.0]), ahead))
    collect(simulation, 5.0)
    simulation.goto(PoseStamped(np.array([0.0, 1.0, 0.0]), ahead))
    height = [m.position_xyz[2] for m in collect(simulation, 6.0)["truth"]]
    assert height == pytest.approx([3.0] * len(height), abs=0.1)


@pytest.mark.parametrize("robot", ["husky", "quadrotor"])
def test_what_is_not_finite_is_refused(robot: str):
    settings = {"husky": BLIND_HUSKY, "quadrotor": BLIND_QUADROTOR}[robot]
    simulation = Simulation(robot, "plane", settings=settings)
    with pytest.raises(UsageError, match="finite"):
        simulation.command(twist(x=math.nan, z=1.0))
    with pytest.raises(UsageError, match="finite"):
        simulation.goto(PoseStamped(np.array([math.inf, 0, 1.0]), np.array([0, 0, 0, 1.0])))


@pytest.mark.parametrize(("asked", "got"), [(0.5, 0.5), (1.0, 1.0), (4.0, 1.0), (-4.0, -1.0)])
def test_the_rover_drives_as_fast_as_asked_up_to_its_top_speed(asked: float, got: float):
    settings = replace(BLIND_HUSKY, command_timeout=30.0)
    simulation = Simulation("husky", "plane", settings=settings)
    simulation.command(twist(x=asked))
    speeds = [m.linear_xyz[0] for m in collect(simulation, 3.0)["truth"]]
    assert np.mean(speeds[-50:]) == pytest.approx(got, abs=0.02)


@pytest.mark.parametrize(
    ("x", "asked", "got"), [(0, 0.3, 0.3), (0, 1, 1), (0.5, -0.8, -0.8), (0, 6, 2)]
)
def test_the_rover_turns_as_fast_as_asked_up_to_its_limit(x: float, asked: float, got: float):
    settings = replace(BLIND_HUSKY, command_timeout=30.0)
    simulation = Simulation("husky", "plane", settings=settings)
    simulation.command(twist(x=x, turn=asked))
    rates = [m.angular_xyz[2] for m in collect(simulation, 5.0)["truth"]]
    assert np.mean(rates[-100:]) == pytest.approx(got, rel=0.06)


@pytest.mark.parametrize(("x", "turn"), [(0, 0.5), (0.5, 0.3), (0.8, 0.5), (0, 2), (1, -1)])
def test_the_rover_rides_calmly_while_it_turns(x: float, turn: float):
    settings = replace(BLIND_HUSKY, command_timeout=30.0, imu_rate=200.0)
    simulation = Simulation("husky", "plane", settings=settings)
    simulation.command(twist(x=x, turn=turn))
    felt = collect(simulation, 4.0)["imu"][300:]
    force, rate = (np.array([getattr(m, k) for m in felt]) for k in ("linear_xyz", "angular_xyz"))
    assert force.std(axis=0) == pytest.approx(0, abs=0.3), "no wheel hops"
    assert rate[:, :2].std(axis=0) == pytest.approx(0, abs=0.03)
    assert force[:, 2].mean() == pytest.approx(9.81, abs=0.3)


def test_the_rover_stands_where_it_was_set_down_and_stops_without_commands():
    simulation = Simulation("husky", "plane", settings=BLIND_HUSKY)
    assert collect(simulation, 2.0)["truth"][-1].position_xyz == pytest.approx(
        [0, 0, 0.132], abs=5e-3
    )
    simulation.command(twist(x=1.0))
    place = np.array([m.position_xyz for m in collect(simulation, 3.0)["truth"]])
    assert 0.3 < place[-1, 0] < 1.0, "half a second's way, and the stopping"
    assert place[-1] == pytest.approx(place[-30], abs=5e-3)


def test_the_rover_goes_to_a_way_point_and_along_a_mission():
    simulation = Simulation("husky", "plane", settings=BLIND_HUSKY)
    simulation.goto(PoseStamped(np.array([2.0, 1.5, 0.0]), np.array([0, 0, 0, 1.0])))
    there = collect(simulation, 8.0)["truth"][-1]
    assert there.position_xyz[:2] == pytest.approx([2.0, 1.5], abs=0.3)
    assert abs(there.quat_xyzw[2]) < 0.05
    simulation.add_mission(Mission(waypoints=((2.0, -1.0, 0.0), (0.0, 0.0, 0.0)), speed=1.0))
    place = np.array([m.position_xyz[:2] for m in collect(simulation, 14.0)["truth"]])
    assert np.linalg.norm(place - (2.0, -1.0), axis=1).min() < 0.5
    assert place[-1] == pytest.approx([0, 0], abs=0.3)
    assert simulation.finished


@pytest.mark.parametrize(("robot", "off_m"), [("husky", 0.12), ("quadrotor", 0.25)])
def test_rows_close_to_each_other_are_mown_to_their_ends(robot: str, off_m: float):
    settings = {"husky": BLIND_HUSKY, "quadrotor": BLIND_QUADROTOR}[robot]
    mission = Mission("lawn_mower", size=(2.5, 0.8), spacing=0.4, height=2.0, speed=1.0, land=False)
    simulation = Simulation(robot, "plane", mission=mission, settings=settings)
    place = np.array([m.position_xyz for m in collect(simulation, 30.0)["truth"]])
    assert simulation.finished
    for corner in mission.route().points:
        off = (place - corner)[:, :2] if robot == "husky" else place - corner
        assert np.linalg.norm(off, axis=1).min() < off_m


@pytest.mark.parametrize("robot", ["husky", "quadrotor"])
def test_an_eight_no_longer_than_three_metres_is_followed(robot: str):
    settings = {"husky": BLIND_HUSKY, "quadrotor": BLIND_QUADROTOR}[robot]
    mission = Mission("figure_of_eight", size=(3.0, 1.0), speed=0.5)
    simulation = Simulation(robot, "plane", mission=mission, settings=settings)
    place = np.array([m.position_xyz for m in collect(simulation, 40.0)["truth"]])
    for point in mission.route().points:
        assert np.linalg.norm((place - point)[:, :2], axis=1).min() < 0.15


def test_the_rover_does_not_slow_down_in_the_curves_of_an_eight():
    mission = Mission("figure_of_eight", size=(8.0, 4.0), laps=0, speed=0.8)
    simulation = Simulation("husky", "plane", mission=mission, settings=BLIND_HUSKY)
    collect(simulation, 4.0)
    speeds = [m.linear_xyz[0] for m in collect(simulation, 20.0)["truth"]]
    assert np.mean(speeds) > 0.75
    assert min(speeds) > 0.5


@pytest.mark.parametrize("world", WORLDS.builtin)
@pytest.mark.parametrize(
    ("robot", "blind"), [("husky", BLIND_HUSKY), ("quadrotor", BLIND_QUADROTOR)]
)
def test_a_robot_is_at_rest_from_the_first_measurement(robot: str, blind: RobotParams, world: str):
    calm = replace(blind, accel_density=0.0, accel_bias=0.0, accel_walk=0.0, imu_rate=200.0)
    simulation = Simulation(robot, world, settings=calm)
    found = collect(simulation, 0.3)
    forces = np.array([m.linear_xyz for m in found["imu"]])
    assert forces == pytest.approx(np.tile([0, 0, 9.81], (len(forces), 1)), abs=0.01)
    x, y, yaw = simulation.world.start(robot)
    first = found["truth"][0]
    assert first.position_xyz[:2] == pytest.approx([x, y], abs=1e-6)
    assert first.quat_xyzw == pytest.approx([0, 0, math.sin(yaw / 2), math.cos(yaw / 2)], abs=1e-6)


def test_both_weigh_what_they_do():
    for robot, settings, mass in (
        ("husky", BLIND_HUSKY, 50.0),
        ("quadrotor", BLIND_QUADROTOR, 1.5),
    ):
        model = Simulation(robot, "plane", settings=settings)._model
        assert model.body_mass.sum() == pytest.approx(mass, abs=1e-3)

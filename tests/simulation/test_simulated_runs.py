"""What a run yields: order, rates, frames, and the same again for the same seed."""

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from simulated_runs import BLIND_HUSKY, BLIND_QUADROTOR, collect, without_camera

from ros_visualise.core.errors import OpenError, ParameterError, UsageError
from ros_visualise.core.params import specs, update
from ros_visualise.simulation.robots import ROBOTS
from ros_visualise.simulation.robots.quadrotor.settings import QuadrotorParams
from ros_visualise.simulation.simulator import Simulation
from ros_visualise.simulation.worlds import WORLDS


def flat(messages: dict) -> dict[str, bytes]:
    """All that a run holds, as bytes."""
    arrays = {
        "imu": lambda m: [m.quat_xyzw, m.angular_xyz, m.linear_xyz],
        "odom": lambda m: [m.position_xyz, m.quat_xyzw, m.linear_xyz, m.angular_xyz],
        "truth": lambda m: [m.position_xyz, m.quat_xyzw],
        "fix": lambda m: [np.array([m.latitude, m.longitude, m.altitude])],
        "points": lambda m: [m.points],
        "mag": lambda m: [m.field_xyz],
        "pressure": lambda m: [np.array([m.pressure])],
    }
    return {
        name: b"".join(array.tobytes() for m in messages[name] for array in parts(m))
        for name, parts in arrays.items()
        if name in messages
    }


@pytest.mark.parametrize("robot", ROBOTS.builtin)
def test_the_same_seed_gives_the_same_data_and_another_one_does_not(robot: str):
    def run(seed: int, **options):
        made = Simulation(robot, "playpen", seed, "default", without_camera(robot), **options)
        return flat(collect(made, 2.0))

    first, other = run(1), run(2)
    assert first == run(1)
    assert all(first[name] != other[name] for name in first if name != "truth")
    assert first["truth"] == other["truth"], "errors of sensors move nothing"
    fewer = run(1, wants=lambda output: output == "imu")
    assert fewer == {name: first[name] for name in fewer}


@pytest.mark.parametrize("robot", ROBOTS.builtin)
def test_messages_come_in_order_of_time_at_their_rates(robot: str):
    simulation = Simulation(robot, "plane", settings=without_camera(robot))
    stamps: dict[str, list[int]] = {}
    last = 0
    for stamp_ns, name, message in simulation.run():
        if stamp_ns >= 2e9:
            break
        assert stamp_ns >= last
        assert message.header.stamp_ns in (stamp_ns, 0)
        last = stamp_ns
        stamps.setdefault(name, []).append(stamp_ns)
    counts = {name: len(found) for name, found in stamps.items()}
    expected = {
        "robot_description": 1,
        "tf_static": 1,
        "scenery": 1,
        "tf": 100,
        "odom": 100,
        "truth": 100,
    }
    expected |= {"imu": 200, "fix": 10, "status": 1}
    expected |= {"husky": {"points": 20}, "quadrotor": {"mag": 100, "pressure": 50}}.get(robot, {})
    assert expected.items() <= counts.items()
    assert set(counts) == set(simulation.outputs)


def test_odd_rates_keep_their_mean():
    settings = replace(BLIND_HUSKY, imu_rate=30.0)
    found = collect(Simulation("husky", "plane", settings=settings), 2.0)["imu"]
    stamps = np.array([m.header.stamp_ns for m in found])
    assert len(stamps) == 60
    assert abs(stamps - np.arange(60) * 1e9 / 30).max() <= 5e6


def frame_tree(messages: dict) -> dict[str, str]:
    sent = [*messages["tf_static"][0].transforms, *messages["tf"][-1].transforms]
    return {t.child_frame_id: t.header.frame_id for t in sent}


@pytest.mark.parametrize("robot", ROBOTS.builtin)
def test_every_message_is_in_a_frame_that_hangs_on_map(robot: str):
    messages = collect(Simulation(robot, "plane", settings=without_camera(robot)), 0.5)
    parents = frame_tree(messages)
    assert parents["odom"] == "map"
    assert parents["base_link"] == "odom"
    used = {
        m[0].header.frame_id
        for n, m in messages.items()
        if n not in ("robot_description", "status")
    }
    for frame in (*used, "camera_optical"):
        while frame != "map":
            frame = parents[frame]


def test_where_odom_is_in_the_map_may_be_left_to_a_navigator():
    ours, left = (
        collect(Simulation("husky", "plane", settings=replace(BLIND_HUSKY, map_to_odom=tells)), 0.1)
        for tells in (True, False)
    )
    (odom,) = [one for one in ours["tf_static"][0].transforms if one.child_frame_id == "odom"]
    assert "odom" not in frame_tree(left)
    (start,) = [one for one in left["tf_static"][0].transforms if one.header.frame_id == "map"]
    assert start.child_frame_id == "odom_start"
    assert np.array_equal(start.translation_xyz, odom.translation_xyz)
    assert np.array_equal(start.quat_xyzw, odom.quat_xyzw)


@pytest.mark.parametrize("gimbal", [True, False])
def test_the_description_is_a_tree_of_the_same_frames(gimbal: bool):
    settings = replace(BLIND_QUADROTOR, camera_gimbal=gimbal)
    for robot, chosen in (("husky", BLIND_HUSKY), ("quadrotor", settings)):
        messages = collect(Simulation(robot, "plane", settings=chosen), 0.1)
        robot_xml = ElementTree.fromstring(messages["robot_description"][0].text)
        links = [link.get("name") for link in robot_xml.iter("link")]
        children = [joint.find("child").get("link") for joint in robot_xml.iter("joint")]
        assert sorted(links) == sorted([*children, "base_link"])
        assert set(children) <= set(frame_tree(messages))
        assert robot_xml.find("link/visual") is not None


def test_odometry_starts_at_zero_and_stays_near_the_truth_for_a_while():
    messages = collect(Simulation("husky", "playpen", 4, "default", BLIND_HUSKY), 10.0)
    assert messages["odom"][0].position_xyz == pytest.approx([0, 0, 0], abs=1e-3)
    truth, odometry = messages["truth"][-1], messages["odom"][-1]
    error = np.linalg.norm((truth.position_xyz - odometry.position_xyz)[:2])
    assert 1e-4 < error < 1.0


@pytest.mark.parametrize("world", WORLDS.builtin)
def test_default_missions_go_on_in_every_world(world: str):
    for robot in ROBOTS.builtin:
        settings = replace(without_camera(robot), lidar=False)
        messages = collect(Simulation(robot, world, 0, "default", settings), 12.0)
        place = np.array([m.position_xyz for m in messages["truth"]])
        assert np.linalg.norm(np.diff(place[-250:], axis=0), axis=1).sum() > 2.0


def test_wrong_names_are_told_with_the_right_ones():
    with pytest.raises(UsageError, match="choose from husky, quadrotor"):
        Simulation("rover")
    with pytest.raises(UsageError, match="choose from plane, playpen, field"):
        Simulation("husky", "moon", settings=BLIND_HUSKY)
    simulation = Simulation("quadrotor", "plane", settings=BLIND_QUADROTOR)
    assert simulation.actions == ("take_off", "land", "stop", "start_mission")
    with pytest.raises(UsageError, match="take_off, land, stop, start_mission"):
        simulation.act("loop")
    with pytest.raises(UsageError, match="no mission for the quadrotor: give one"):
        simulation.act("start_mission")


@pytest.mark.parametrize("params", [ROBOTS.find(name).params for name in ROBOTS.builtin])
def test_settings_are_declared_parameters(params: type):
    told = [spec for spec in specs(params) if spec.type is not bool]
    assert all(spec.help and (spec.range or spec.choices) for spec in told)
    with pytest.raises(ParameterError, match="from 1 to 200"):
        update(params(), {"imu_rate": 1000})
    assert update(QuadrotorParams(), {"camera_pitch": "45"}).camera_pitch == 45.0


def test_a_missing_extra_is_one_line(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    with pytest.raises(OpenError, match=r"pip install 'ros_visualise\[sim\]'"):
        Simulation("husky", "plane", settings=BLIND_HUSKY)

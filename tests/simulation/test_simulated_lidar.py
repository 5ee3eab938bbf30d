"""The lidar's rays, against MuJoCo's own cast of all of them and against a known wall."""

import math
from dataclasses import replace

import numpy as np
import pytest
from simulated_runs import collect

from ros_visualise.simulation.attitude import from_rotation_vector, rows
from ros_visualise.simulation.engine import load_mujoco
from ros_visualise.simulation.rays import StaticGeoms
from ros_visualise.simulation.robots.husky.settings import HuskyParams
from ros_visualise.simulation.sensors.lidar import Lidar
from ros_visualise.simulation.simulator import Simulation

SIGHTED = replace(HuskyParams(), camera=False)


@pytest.mark.parametrize("world", ["field", "playpen"])
def test_every_ray_meets_what_mujoco_has_it_meet(world: str):
    simulation = Simulation("husky", world, settings=SIGHTED)
    model, data = simulation._model, simulation._data
    lidar = Lidar(SIGHTED, 0, model, data)
    random = np.random.default_rng(4)
    for _ in range(6):
        place = np.array([*random.uniform(-9, 9, 2), random.uniform(0.3, 3)])
        R = np.array(rows(from_rotation_vector(*(random.normal(size=3) * (0.2, 0.2, 3)).tolist())))
        ranges, _ = lidar.cast(place, R)
        whole = cast_all(model, data, place, (R @ lidar._rays).T)
        near = np.minimum(ranges, whole) < 40  # where even the smallest ground has not ended
        assert ranges[near] == pytest.approx(whole[near], abs=SIGHTED.lidar_noise / 20)
        assert np.median(abs(ranges[near] - whole[near])) < 1e-6


def test_rays_along_the_axes_of_geoms_hit_them_as_mujoco_has_it():
    mujoco = load_mujoco()
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><geom type="sphere" size=".5" pos="9 0 0"/>
        <geom type="ellipsoid" size="1 2 3" pos="-9 0 0"/>
        <geom type="cylinder" size=".5 1" pos="0 0 -9"/>
        <geom type="cylinder" size=".5 1" euler="90 0 0" pos="0 9 0"/>
        <geom type="box" size="1 2 3" pos="0 -9 0"/><geom type="box" size="9 9 9"/>
        </worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rays = np.array([[s if j == i else 0.0 for j in range(3)] for i in range(3) for s in (-1, 1)])
    for place in np.zeros(3), np.array([0.2, -0.1, 0.3]):
        geoms, each = np.repeat(np.arange(6), 6), np.tile(rays, (6, 1))
        static, counts = StaticGeoms(model, data, np.arange(6)), np.full(6, 6)
        found, met = static.intersect(place, np.eye(3), each.T.astype(np.float32), counts)
        expected = [cast_at(model, data, place, ray, g) for g, ray in zip(geoms, each, strict=True)]
        assert np.where(met, found, np.inf) == pytest.approx(np.array(expected), abs=1e-5)
        assert met.sum() >= 11


def cast_at(model, data, place: np.ndarray, ray: np.ndarray, geom: int) -> float:
    """The range at which MuJoCo's ray meets that geom alone."""
    model.geom_group[:] = 1
    model.geom_group[geom] = 0
    return cast_all(model, data, place, ray[None])[0]


def cast_all(model, data, place: np.ndarray, rays: np.ndarray) -> np.ndarray:
    count = len(rays)
    geoms, ranges = np.empty(count, np.int32), np.empty(count)
    groups = np.array([1, 0, 0, 0, 0, 0], np.uint8)
    load_mujoco().mj_multiRay(
        model, data, place, rays.ravel(), groups, 1, -1, geoms, ranges, None, count, 100.0
    )
    return np.where(ranges < 0, np.inf, ranges)


def test_ranges_to_a_wall_are_right_within_their_noise():
    cloud = collect(Simulation("husky", "playpen", settings=SIGHTED), 0.05)["points"][0]
    xyz = cloud.xyz.astype(np.float64)
    ahead = np.degrees(np.arctan2(xyz[:, 1], xyz[:, 0]))
    wall = (abs(ahead + 25) < 4) & (abs(xyz[:, 2]) < 0.2) & (xyz[:, 0] > 9)
    assert wall.sum() > 30
    ray = xyz[wall] / np.linalg.norm(xyz[wall], axis=1)[:, None]
    true = (10 - 0.12 - 0.08) / ray[:, 0]  # the barrier's face, from where the lidar stands
    errors = np.linalg.norm(xyz[wall], axis=1) - true
    assert errors.std() == pytest.approx(SIGHTED.lidar_noise, rel=0.35)
    assert errors.mean() == pytest.approx(0, abs=0.01)


def test_noise_is_white_and_a_scan_has_its_own_whichever_was_before():
    simulation = Simulation("husky", "playpen", settings=SIGHTED)
    model, data = simulation._model, simulation._data
    place, R = np.array([0.0, 0.0, 0.6]), np.eye(3)
    lidar = Lidar(SIGHTED, 5, model, data)
    ranges, _ = lidar.cast(place, R)
    true = ranges[(ranges >= SIGHTED.lidar_near) & (ranges <= SIGHTED.lidar_far)]
    clouds = [lidar.measure(0, index, place, R) for index in (*range(12), 500, 10_000)]
    noise = [np.linalg.norm(cloud.xyz.astype(np.float64), axis=1) - true for cloud in clouds]
    assert np.std(noise, axis=1) == pytest.approx(SIGHTED.lidar_noise, rel=0.05)
    assert np.mean(noise, axis=1) == pytest.approx(0, abs=0.05 * SIGHTED.lidar_noise)
    likeness = np.corrcoef(noise) - np.eye(len(noise))
    assert abs(likeness).max() < 5 / math.sqrt(len(true))
    neighbours = [np.corrcoef(each[:-1], each[1:])[0, 1] for each in noise]
    assert abs(np.array(neighbours)).max() < 5 / math.sqrt(len(true))
    again = Lidar(SIGHTED, 5, model, data).measure(0, 500, place, R)
    assert again.points.tobytes() == clouds[-2].points.tobytes()
    other = Lidar(SIGHTED, 6, model, data).measure(0, 500, place, R)
    assert other.points.tobytes() != again.points.tobytes()


def test_a_rays_noise_does_not_depend_on_what_others_meet():
    simulation = Simulation("husky", "playpen", settings=SIGHTED)
    model, data, place = simulation._model, simulation._data, np.array([0.0, 0.0, 0.6])
    far = Lidar(SIGHTED, 5, model, data).measure(0, 7, place, np.eye(3)).points
    near = Lidar(replace(SIGHTED, lidar_far=6.0), 5, model, data).measure(0, 7, place, np.eye(3))
    assert 0 < len(near.points) < len(far)
    assert {p.tobytes() for p in near.points} <= {p.tobytes() for p in far}


def test_the_ground_is_flat_and_rings_rise():
    cloud = collect(Simulation("husky", "plane", settings=SIGHTED), 0.05)["points"][0]
    assert len(cloud.points) == 8 * 900, "half of the rows look down"
    height = 0.132 + 0.47
    off = cloud.xyz[:, 2] + height
    grazing = np.sin(np.radians(15))
    assert abs(off).max() < 5 * SIGHTED.lidar_noise * grazing + 0.02
    away = np.hypot(cloud.xyz[:, 0], cloud.xyz[:, 1])
    by_ring = [away[cloud.points["ring"] == ring].mean() for ring in range(8)]
    assert by_ring == sorted(by_ring)
    assert by_ring[0] == pytest.approx(height / math.tan(math.radians(15)), rel=0.02)


def test_layout_and_rate_are_as_declared():
    settings = replace(SIGHTED, lidar_rings=4, lidar_columns=90, lidar_rate=5.0, lidar_high=-5.0)
    clouds = collect(Simulation("husky", "plane", settings=settings), 1.0)["points"]
    assert len(clouds) == 5
    assert all(len(cloud.points) == 4 * 90 for cloud in clouds)
    assert clouds[0].header.frame_id == "lidar_link"

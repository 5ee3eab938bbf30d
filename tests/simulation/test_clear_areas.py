"""The named shapes fit into every world."""

import mujoco
import numpy as np
import pytest
from simulated_runs import BLIND_HUSKY, collect

from ros_visualise.simulation.missions import SHAPES, Mission, read_mission
from ros_visualise.simulation.model import build_world, compile_model
from ros_visualise.simulation.route import Route
from ros_visualise.simulation.simulator import Simulation
from ros_visualise.simulation.worlds import WORLDS

HALF_WIDTH_M, MARGIN_M = 0.335, 0.3
SOLID = 2


def footprints(world: str) -> np.ndarray:
    """(N, 4) least x and y, greatest x and y of all that a robot bumps into."""
    model = compile_model("husky", build_world(world, False), BLIND_HUSKY)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    found = []
    for geom in np.flatnonzero((model.geom_bodyid == 0) & (model.geom_contype & SOLID > 0)):
        turned = data.geom_xmat[geom].reshape(3, 3)
        middle = data.geom_xpos[geom] + turned @ model.geom_aabb[geom, :3]
        reach = np.abs(turned) @ model.geom_aabb[geom, 3:]
        found.append([*(middle - reach)[:2], *(middle + reach)[:2]])
    return np.array(found).reshape(-1, 4)


def clearance(way_xy: np.ndarray, boxes: np.ndarray) -> float:
    """From a way's points to the nearest footprint, metres."""
    outside = np.maximum(boxes[:, :2] - way_xy[:, None], way_xy[:, None] - boxes[:, 2:])
    return float(np.linalg.norm(outside.clip(0), axis=2).min(initial=np.inf))


def way_of(mission: Mission, start_xy: tuple[float, float]) -> np.ndarray:
    route = mission.route()
    there = Route([(*start_xy, 0.0), (*route.points[0][:2], 0.0)])
    ways = [[r.at(m)[:2] for m in np.arange(0, r.length_m, 0.05)] for r in (there, route)]
    return np.array([*ways[0], *ways[1]])


@pytest.mark.parametrize("world", WORLDS.builtin)
def test_every_shape_is_clear_of_what_stands_in_the_world(world: str):
    boxes, built = footprints(world), build_world(world, False)
    assert (len(boxes) > 0) == (world != "plane")
    for shape in SHAPES:
        center, size = WORLDS.find(world).clear_area(shape)
        for x, y, _ in map(built.start, ("husky", "quadrotor")):
            way = way_of(Mission(shape, size, center), (x, y))
            assert clearance(way, boxes) > HALF_WIDTH_M + MARGIN_M, (world, shape)


def test_a_shape_where_something_stands_is_seen():
    way = way_of(Mission("square", (8.0, 8.0)), (0.0, 0.0))
    assert clearance(way, footprints("playpen")) == 0, "a pillar is at (0, -4)"


def test_a_file_without_a_place_has_the_room_of_its_shape(tmp_path):
    path = tmp_path / "mission.yaml"
    path.write_text("shape: lawn_mower\nsize: 3\n")
    field = WORLDS.find("field")
    mission = read_mission(path, field)
    assert (mission.center, mission.size) == (field.clear_area("lawn_mower").center, (3, 3))


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("world", [world for world in WORLDS.builtin if world != "plane"])
def test_the_rover_begins_every_shape_without_bumping_into_anything(world: str, shape: str):
    simulation = Simulation("husky", world, mission=shape, settings=BLIND_HUSKY)
    place = np.array([m.position_xyz[:2] for m in collect(simulation, 16.0)["truth"]])
    assert np.linalg.norm(np.diff(place, axis=0), axis=1).sum() > 8.0
    assert clearance(place, footprints(world)) > 2 * HALF_WIDTH_M

"""Bodies that stand about in the made pictures have the shapes of what they are."""

from typing import Any

import numpy as np
import pytest
from bodies import build_vehicle
from outlines import body_parts

mujoco = pytest.importorskip("mujoco")
WHEELS = 4


@pytest.fixture(scope="module", params=range(40))
def vehicle(request: pytest.FixtureRequest) -> Any:
    """A model with one vehicle, and its parts in the vehicle's frame."""
    meshes, geoms = build_vehicle(np.random.default_rng(request.param), "car")
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><asset>{meshes}</asset><worldbody>"
        f'<body name="car">{geoms}</body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, body_parts(model, data, model.body("car").id)


def test_a_vehicle_stands_on_four_wheels(vehicle):
    """Nothing else touches the ground, and no wheel is as high as the body."""
    model, parts = vehicle
    low = np.array([part[:, 2].min() for part in parts])
    wheels = model.geom_type == mujoco.mjtGeom.mjGEOM_CYLINDER
    assert wheels.sum() == WHEELS
    np.testing.assert_allclose(low[wheels], 0, atol=1e-3)
    assert (low[~wheels] > 0.1).all()
    body = max(parts[number][:, 2].max() for number in mesh_numbers(model))
    assert max(parts[number][:, 2].max() for number in np.flatnonzero(wheels)) < body


def test_a_vehicle_is_longer_than_wide_and_the_same_on_both_sides(vehicle):
    model, parts = vehicle
    points = np.concatenate([parts[number] for number in mesh_numbers(model)])
    low, high = points.min(axis=0), points.max(axis=0)
    size = high - low
    assert 3 < size[0] < 9.5
    assert 1.1 < size[1] < 2.7
    assert size[0] > 1.8 * size[1]
    assert low[1] == pytest.approx(-high[1], abs=1e-3)


def test_ends_of_a_vehicle_are_no_wider_or_higher_than_its_middle(vehicle):
    """Its bonnet falls to the front, and its corners are round, more or less."""
    model, parts = vehicle
    body = max(
        (parts[number] for number in mesh_numbers(model)), key=lambda part: np.ptp(part[:, 0])
    )
    at_end = np.abs(body[:, 0]) > np.abs(body[:, 0]).max() - 0.01
    for axis in (1, 2):
        assert body[at_end, axis].max() <= body[~at_end, axis].max() + 1e-6


def mesh_numbers(model: Any) -> list[int]:
    """The geoms that are meshes: its body and its cabin."""
    return [int(each) for each in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)]

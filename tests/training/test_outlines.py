"""Boxes and ground points of the pictures to train on come from the geometry."""

from types import SimpleNamespace

import numpy as np
import pytest
from outlines import View, body_parts, box_of, clip_parts, hull_of, turned_sides, visible_share

mujoco = pytest.importorskip("mujoco")

DOWN = np.diag([1.0, -1.0, -1.0])
"""R_map_camera of a camera that looks straight down, its upper edge to the north."""


def view_from(height: float, x: float = 0.0) -> View:
    return View(np.array([x, 0.0, height]), DOWN, 100.0, (201, 101))


def scene(bodies: str) -> SimpleNamespace:
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return SimpleNamespace(model=model, data=data)


def test_a_point_below_the_camera_is_in_the_middle():
    uv, depth = view_from(10.0).project(np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 0.0]]))
    np.testing.assert_allclose(uv, [[100, 50], [110, 30]])
    np.testing.assert_allclose(depth, 10)


def test_a_ray_goes_through_its_pixel():
    view = view_from(7.0, x=3.0)
    ahead = view.ray(np.array([130.0, 20.0]))
    uv, _ = view.project((view.position_xyz + 5 * ahead)[None])
    np.testing.assert_allclose(uv[0], [130, 20])
    assert np.linalg.norm(ahead) == pytest.approx(1)


@pytest.mark.parametrize(
    ("geom", "half"),
    [
        ('type="box" size="1 2 3"', (1, 2, 3)),
        ('type="cylinder" size="1 2"', (1, 1, 2)),
        ('type="sphere" size="1.5"', (1.5, 1.5, 1.5)),
        ('type="ellipsoid" size="1 2 3"', (1, 2, 3)),
        ('type="capsule" size="1 2"', (1, 1, 3)),
    ],
)
def test_the_outline_of_a_geom_reaches_as_far_as_it_does(geom: str, half: tuple[float, ...]):
    """In the body's frame, wherever the body stands."""
    world = scene(f'<body name="a" pos="5 6 7" euler="0 0 30"><geom {geom} pos="0 0 1"/></body>')
    (part,) = body_parts(world.model, world.data, world.model.body("a").id)
    np.testing.assert_allclose(part.max(axis=0), np.add(half, (0, 0, 1)), atol=0.01)
    np.testing.assert_allclose(part.min(axis=0), np.subtract((0, 0, 1), half), atol=0.01)


def test_a_turned_mesh_keeps_its_corners():
    """MuJoCo moves a mesh's frame to its middle; the outline is where the corners were given."""
    mesh = '<mesh name="m" vertex="0 0 0  4 0 0  0 2 0  0 0 1"/>'
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><asset>{mesh}</asset><worldbody>"
        '<body name="a" pos="1 2 3"><geom type="mesh" mesh="m"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    (part,) = body_parts(model, data, model.body("a").id)
    want = sorted([(0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0, 1.0)])
    np.testing.assert_allclose(sorted(map(tuple, np.round(part, 5) + 0.0)), want, atol=1e-4)


def test_a_box_is_cut_at_the_picture_and_known_beyond_it():
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    view = view_from(10.0, x=10.5)  # the square's middle is 105 px left of the picture's
    clipped = clip_parts(view, (square,))
    assert clipped is not None
    polygons, whole = clipped
    np.testing.assert_allclose(whole, [-15, 40, 5, 60])
    np.testing.assert_allclose(box_of(polygons), [-0.5, 40, 5, 60], atol=1e-3)


def test_a_turned_square_is_cut_tightly():
    """At the edge of the picture, less of it is left than of its box."""
    diamond = np.array([[10, 0, 0], [0, 10, 0], [-10, 0, 0], [0, -10, 0]], float)
    polygons, _ = clip_parts(view_from(10.0, x=17.0), (diamond,)) or ([], None)
    box = box_of(polygons)  # the diamond's middle at u = -70, its right corner at u = 30
    np.testing.assert_allclose(box, [-0.5, 19.5, 30, 80.5], atol=1e-3)


def test_what_reaches_behind_the_camera_has_no_box():
    post = np.array([[0, 0, 0], [0, 0, 20]], float)
    assert clip_parts(view_from(10.0), (post,)) is None


def test_half_hidden_is_half_visible():
    world = scene(
        '<body name="a"><geom type="box" size="1 1 .1"/></body>'
        '<body name="b" pos="1 0 2"><geom type="box" size="1 3 .1"/></body>'
    )
    view = view_from(50.0)
    body = world.model.body("a").id
    parts = body_parts(world.model, world.data, body)
    polygons, _ = clip_parts(view, parts) or ([], None)
    random = np.random.default_rng(0)
    shares = [visible_share(world, view, body, polygons, random) for _ in range(40)]
    assert np.mean(shares) == pytest.approx(0.5, abs=0.08)


@pytest.mark.parametrize("degrees", [0, 20, 45])
def test_sides_are_those_of_the_thing_however_it_is_turned(degrees: float):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    bar = np.array([[-30, -2], [30, -2], [30, 2], [-30, 2]]) @ np.array([[c, s], [-s, c]])
    np.testing.assert_allclose(turned_sides([bar[:3], bar[2:]]), [60, 4], atol=0.01)


def test_a_hull_goes_around_all_polygons():
    squares = [np.array([[x, 0], [x + 1, 0], [x + 1, 1], [x, 1]], float) for x in (0, 4)]
    hull = hull_of(squares)
    assert {tuple(corner) for corner in hull} == {(0, 0), (5, 0), (5, 1), (0, 1)}

"""Laws of an image's update: its sparse Jacobian, and many landmarks at once as one by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from world import CAMERA, DOWN, HERE, Sensor, World, tags_on_ground

from ros_visualise.estimation import updating
from ros_visualise.estimation.camera_view import view_of
from ros_visualise.estimation.measuring import CAMERAS, Pair, camera_of, measure, turn_of
from ros_visualise.estimation.robot import RobotState, core
from ros_visualise.estimation.state import State
from ros_visualise.geometry import se3

TAGS = tags_on_ground([(x, y, -5) for x in (-1.0, 0, 1.0) for y in (-0.8, 0.8)])


@pytest.fixture(scope="module")
def seen():
    """Six tags from above, of which the last has no corners but a pose, with random errors."""
    random = np.random.default_rng(3)
    events = World(lambda t: HERE, TAGS, images=Sensor(5, priority=1)).events(1)
    message = next(one.message for one in events if one.port == "detections")
    view = view_of(message, se3.from_parts(DOWN, CAMERA.p))
    *tags, last = view.sights
    view = replace(view, sights=(*tags, replace(last, rays=None)))
    root = random.normal(size=(core(), core())) * 0.003
    state = State(RobotState(v=random.normal(size=3), rates=random.normal(size=3)), root @ root.T)
    for name, tag in TAGS.items():
        R, p = se3.moved(random.normal(0, 0.005, 6), tag.pose.R, tag.pose.p)
        state.add(name, R, p, np.eye(6) * 1e-4, 0.02)
        state.share(state.rows(name), random.normal(size=(6, 6)) / 3)
    return view, [Pair(sight, sight.name) for sight in view.sights], state


def residuals(view, pairs, state):
    return np.concatenate([one.residual.ravel() for one in measure(view, pairs, state)])


def test_the_jacobian_of_an_image_is_the_numerical_one(seen):
    view, pairs, state = seen
    columns = updating._columns(view, pairs, state)
    H = updating.ImageJacobian(measure(view, pairs, state)) @ np.eye(len(columns))
    assert H.shape == (8 * 5 + 6, len(columns))
    for place, column in enumerate(columns):
        if column == CAMERAS[0].rows.start:
            continue  # the clock: its motion is that of one instant
        ahead, back = (
            residuals(view, pairs, state.moved(np.eye(state.size)[column] * step))
            for step in (1e-6, -1e-6)
        )
        numerical = (back - ahead) / 2e-6
        np.testing.assert_allclose(H[:, place], numerical, rtol=0.02, atol=0.02 * np.abs(H).max())


def test_landmarks_updated_together_are_as_if_one_by_one(seen, monkeypatch):
    view, pairs, state = seen
    monkeypatch.setattr(updating, "_settled", lambda variances: np.zeros(len(variances)))
    together, one_by_one = updating.update_each(state, view, pairs), state
    for pair in pairs:
        free = np.zeros(state.size, bool)
        free[state.rows(pair.key)] = free[state.size_of(pair.key)] = True
        one_by_one = updating.update(one_by_one, view, [pair], free)
    assert np.abs(together.landmarks_p - state.landmarks_p).max() > 1e-3
    np.testing.assert_allclose(together.joint, one_by_one.joint, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(together.landmarks_p, one_by_one.landmarks_p, atol=1e-9)
    np.testing.assert_allclose(together.landmarks_R, one_by_one.landmarks_R, atol=1e-9)
    np.testing.assert_array_equal(together.robot.p, state.robot.p)
    np.testing.assert_array_equal(together.P[: core(), : core()], state.P[: core(), : core()])


def test_an_image_by_a_vaguer_camera_is_compared_as_if_the_state_were_so(seen):
    view, pairs, state = seen
    view, turn = replace(view, turning=np.array([0.3, -0.2, 0.5])), turn_of(0)
    vaguer = state.copy()
    vaguer.inflate(turn, 0.04 * np.eye(3))
    as_stated, more = updating.together(view, pairs, state, turn, 0.04)
    assert more.distance2 < as_stated.distance2
    expected, _ = updating.together(view, pairs, vaguer, turn, 1.0)
    np.testing.assert_allclose(more, expected, rtol=1e-6)


def test_a_gimbal_keeps_the_camera_level_while_a_late_clock_turns_the_robot(seen):
    rates, late_s = np.array([0.3, -0.4, 0.5]), 0.08
    robot = RobotState(v=np.array([1.0, 2, 0]), rates=rates)
    view = replace(seen[0], turning=-seen[0].R_base_camera.T @ rates)
    late = camera_of(view, robot.with_own(CAMERAS[0], np.array([late_s, 0, 0, 0, 0])))
    now = camera_of(view, robot)
    turned = se3.exp(np.concatenate([np.zeros(3), late_s * rates]))[0][:3, :3]
    np.testing.assert_allclose(late.R, now.R, atol=5e-4)  # the axes of the rates turn, too
    np.testing.assert_allclose(late.p, turned @ view.p_base_camera + late_s * robot.v, atol=1e-9)
    fixed = replace(view, turning=np.zeros(3))
    np.testing.assert_allclose(camera_of(fixed, robot).by_camera[3:, 0], rates)
    np.testing.assert_allclose(now.by_camera[3:, 0], 0, atol=1e-12)

"""Control of the quadrotor: laws of what its controller asks for."""

import math

import pytest

from ros_visualise.simulation.attitude import rows, yaw_of
from ros_visualise.simulation.robots.quadrotor.control import Quadrotor
from ros_visualise.simulation.robots.quadrotor.flight import _attitude
from ros_visualise.simulation.simulator import Simulation


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.5, 3.1])
@pytest.mark.parametrize("tilt_deg", [0.0, 10.0, 35.0, 80.0])
@pytest.mark.parametrize("towards", [0.0, 0.9, 2.2, -1.6])
def test_a_tilted_body_heads_where_it_was_asked_to_and_pushes_along_the_force(
    yaw, tilt_deg, towards
):
    tilt = math.radians(tilt_deg)
    aside = 14.7 * math.sin(tilt)
    force = aside * math.cos(towards), aside * math.sin(towards), 14.7 * math.cos(tilt)
    attitude = _attitude(force, yaw)
    assert math.hypot(*attitude) == pytest.approx(1)
    assert yaw_of(attitude) == pytest.approx(yaw)
    assert [14.7 * row[2] for row in rows(attitude)] == pytest.approx(force)


def test_the_controller_knows_the_model_that_it_flies():
    quadrotor = Simulation("quadrotor", "plane")._robot
    assert isinstance(quadrotor, Quadrotor)
    frame = quadrotor._controller._frame
    assert frame.mass == pytest.approx(1.5)
    assert frame.inertia == pytest.approx((0.0291, 0.0291, 0.0552))
    assert (frame.arm, frame.drag, frame.max_thrust) == pytest.approx((0.177, 0.016, 7.5))

"""A place corrects the robot when it is seen again, and not before."""

import numpy as np
import pytest

from ros_visualise.estimation.camera_view import CameraView, ObservedPose, Sighting
from ros_visualise.estimation.navigator import Navigator
from ros_visualise.estimation.settings import CameraErrors, NavigatorSettings
from ros_visualise.geometry import rigid

STEP_NS = 100_000_000
LEVEL = np.array([0.0, 0, 0, 1])


def view(stamp_ns, ahead_m, sigma, name="place_1"):
    """A landmark straight ahead of a camera that looks along the robot's axes."""
    at, P = np.array([ahead_m, 0.0, 0.0]), np.eye(6) * sigma**2
    pose = ObservedPose(np.eye(3), at, P, 1.0, True)
    sight = Sighting(name, 1, 0.0, None, np.zeros((8, 8)), (pose,))
    return CameraView(stamp_ns, np.eye(3), np.zeros(3), (sight,), {}, str(stamp_ns).encode())


@pytest.mark.parametrize(("name", "left_m"), [("place_1", 0.02), ("tag_1", 0.2)])
def test_one_sighting_maps_a_place_and_the_second_corrects_the_robot(name, left_m):
    """10 m ahead and back, with an odometry that says 9.8 m for the way back."""
    navigator, numbers = Navigator(NavigatorSettings(camera=CameraErrors(clock_s=0.0))), range(101)
    for n in numbers:
        x = 0.2 * min(n, 50) - 0.196 * max(n - 50, 0)
        now = navigator.odometry(n * STEP_NS, rigid.pose(np.array([x, 0, 0]), LEVEL))
        if n == 0:
            navigator.see(view(0, 5.0, 1e-3, name))
        assert now.T_map_base[0, 3] == pytest.approx(x, abs=0.02)
    assert navigator.see(view(100 * STEP_NS, 5.0, 0.02, name))
    after = navigator.odometry(101 * STEP_NS, rigid.pose(np.array([0.2, 0, 0]), LEVEL))
    assert after.T_map_base[0, 3] == pytest.approx(left_m, abs=0.03)

"""Images show known things where the camera's model says."""

import math
import os
import subprocess
import sys
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from simulated_runs import collect

from ros_visualise.core.errors import OpenError
from ros_visualise.data import Image
from ros_visualise.simulation.rendering import choose_backend
from ros_visualise.simulation.robots.husky.settings import HuskyParams
from ros_visualise.simulation.robots.quadrotor.settings import QuadrotorParams
from ros_visualise.simulation.sensors import camera
from ros_visualise.simulation.sensors.camera import CameraSensor
from ros_visualise.simulation.simulator import Simulation


@pytest.fixture(scope="module")
def quadrotor() -> Simulation:
    return Simulation("quadrotor", "field", settings=replace(QuadrotorParams(), camera_noise=0.0))


@pytest.fixture(scope="module")
def husky() -> Simulation:
    return Simulation(
        "husky", "field", settings=replace(HuskyParams(), lidar=False, camera_noise=0.0)
    )


@cache
def camera_of(simulation: Simulation) -> CameraSensor:
    return CameraSensor(simulation.settings, 0, simulation._model)


def look(simulation: Simulation, position_xyz: np.ndarray, R: np.ndarray) -> Image:
    simulation._data.cam_xpos[0] = position_xyz
    return camera_of(simulation).measure(0, 0, simulation._data, position_xyz, R)


def project(
    image: Image, points_xyz: np.ndarray, position: np.ndarray, R: np.ndarray
) -> np.ndarray:
    """Pixels (N, 2), origin at the centre of the top-left one."""
    assert image.camera_info is not None
    local = (points_xyz - position) @ R @ image.camera_info.K.T
    return local[:, :2] / local[:, 2:]


def corners_in(image: Image) -> dict[int, np.ndarray]:
    """Tag -> its corners' pixels as OpenCV finds and refines them, but from the upper left on.

    OpenCV's dictionary has the tags upside down.
    """
    found = cv2.aruco.ArucoDetector(
        cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11), parameters()
    ).detectMarkers(cv2.cvtColor(image.pixels, cv2.COLOR_RGB2GRAY))
    corners, ids, _ = found
    return (
        {int(i): np.roll(c[0], 2, axis=0) for i, c in zip(np.ravel(ids), corners, strict=True)}
        if len(corners)
        else {}
    )


def parameters():
    chosen = cv2.aruco.DetectorParameters()
    chosen.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    chosen.minMarkerDistanceRate = 0.02  # OpenCV 4.8 takes a tag and the edge of its paper for one
    return chosen


DOWN = np.array([[0.0, -1, 0], [-1, 0, 0], [0, 0, -1]])  # R_map_optical, its top to the east


def tilted(roll: float, pitch: float) -> np.ndarray:
    turn, _ = cv2.Rodrigues(np.array([roll, pitch, 0.2]))
    return turn @ DOWN


@pytest.mark.parametrize("R", [DOWN, tilted(0.2, -0.15)], ids=["level", "tilted"])
@pytest.mark.parametrize("tag", ["tag_10", "tag_12", "tag_15"])
@pytest.mark.usefixtures("opengl")
def test_a_tag_on_the_ground_is_on_the_pixels_of_the_model(quadrotor, tag: str, R: np.ndarray):
    landmark = quadrotor.world.landmark(tag)
    place = np.add(landmark.position_xyz, (0.2, -0.1, 2.5))
    image = look(quadrotor, place, R)
    expected = project(image, landmark.corners(), place, R)
    found = corners_in(image)[landmark.tag_id]
    assert np.linalg.norm(found - expected, axis=1).max() < 0.5


@pytest.mark.parametrize("tag", ["tag_0", "tag_3", "tag_6"])
@pytest.mark.usefixtures("opengl")
def test_an_upright_board_is_on_the_pixels_of_the_model(husky, tag: str):
    landmark = husky.world.landmark(tag)
    x, y, z = landmark.R_map_landmark.T
    R = np.stack([x, -y, -z], axis=1)
    place = np.array(landmark.position_xyz) + 1.5 * z + 0.2 * x
    image = look(husky, place, R)
    expected = project(image, landmark.corners(), place, R)
    assert np.linalg.norm(corners_in(image)[landmark.tag_id] - expected, axis=1).max() < 0.5


@pytest.mark.usefixtures("opengl")
def test_calibration_goes_with_the_image(husky):
    found = collect(husky, 0.3)["image"]
    assert len(found) == 3
    image, info = found[-1], found[-1].camera_info
    assert info.header == image.header
    assert image.header.frame_id == "camera_optical"
    assert (image.width, image.height) == (info.width, info.height) == (640, 480)
    assert info.K[0, 0] == pytest.approx(320 / math.tan(math.radians(40)))
    assert info.K[:2, 2].tolist() == [319.5, 239.5]
    assert info.P[:, :3].tolist() == info.K.tolist()


@pytest.mark.usefixtures("opengl")
def test_noise_is_as_declared_and_of_the_seed():
    settings = replace(QuadrotorParams(), camera_width=320, camera_height=240, camera_noise=3.0)
    runs = [
        collect(Simulation("quadrotor", "plane", seed, settings=settings), 0.15)["image"]
        for seed in (1, 1, 2)
    ]
    same, again, other = (np.array([i.pixels for i in run], int) for run in runs)
    assert (same == again).all()
    assert (same != other).any()
    difference = same[1] - other[1]
    assert difference.std() == pytest.approx(3 * math.sqrt(2), rel=0.05)


def test_a_gimbal_keeps_the_camera_level():
    for gimbal in (True, False):
        settings = replace(
            QuadrotorParams(), camera_gimbal=gimbal, camera_width=64, camera_height=48
        )
        mount = Simulation("quadrotor", "plane", settings=settings)._fitting.mount
        turn, _ = cv2.Rodrigues(np.array([0.3, 0.1, 0.0]))
        _, R = mount.optical_in_map(np.zeros(3), turn)
        straight_down = R[:, 2] @ (0, 0, -1)
        assert straight_down == pytest.approx(1 if gimbal else turn[2, 2])


def test_no_opengl_is_one_line_that_says_what_to_do(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setenv("MUJOCO_GL", "glfw")
    with pytest.raises(OpenError, match=r"glfw tried.*: unset MUJOCO_GL, or apt install libegl1"):
        choose_backend.__wrapped__()
    monkeypatch.setenv("MUJOCO_GL", "off")
    with pytest.raises(OpenError, match="turn the camera off"):
        choose_backend.__wrapped__()


def test_a_platform_that_mujoco_does_not_know_is_one_line():
    done = subprocess.run(
        [sys.executable, "-m", "ros_visualise", "sim", "husky", "--world", "plane"],
        env={**os.environ, "MUJOCO_GL": "nonsense"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.strip().count("\n") == 0
    assert "MUJOCO_GL=nonsense does not work on this machine: unset MUJOCO_GL" in done.stderr


def test_images_that_nobody_wants_are_not_made(monkeypatch):
    monkeypatch.setattr(camera, "Renderer", lambda *_: pytest.fail("an image was made"))
    simulation = Simulation("husky", "plane", wants=lambda output: output != "image")
    assert "image" not in collect(simulation, 0.3)

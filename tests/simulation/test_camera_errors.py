"""Lens, shutter, exposure, light and mount of the simulated camera, measured in its pixels.

Corners that OpenCV finds are compared with projections computed here, by OpenCV's own lens model
and from poses at the time of each row.
"""

import math
from collections import deque
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from simulated_runs import BLIND_QUADROTOR, collect
from test_simulated_camera import DOWN, corners_in

from ros_visualise.core.errors import OpenError
from ros_visualise.geometry import rotations
from ros_visualise.simulation import sensors
from ros_visualise.simulation.camera_mount import CameraMount
from ros_visualise.simulation.missions import Mission
from ros_visualise.simulation.rendering import Renderer
from ros_visualise.simulation.robots.quadrotor.settings import QuadrotorParams
from ros_visualise.simulation.sensors.camera import CameraSensor
from ros_visualise.simulation.simulator import Simulation

CLEAN = replace(QuadrotorParams(), camera_noise=0.0, camera_rate=5.0)
LENS = {"camera_k1": -0.22, "camera_k2": 0.06, "camera_p1": 0.002, "camera_p2": -0.001}
TAG = "tag_10"
STILL = np.zeros(3)


@cache
def world_for(settings):
    """The world that cameras of any noise see in any light."""
    return Simulation("quadrotor", "field", settings=settings)


renderer_for = cache(Renderer)
"""Of a world; to open OpenGL takes as long as to draw a hundred images."""


def shoot(settings, offset, R=DOWN, motion=(STILL, STILL)):
    """An image of the tag from ``offset`` above it, the tag's corners, and the camera's place."""
    simulation = world_for(replace(settings, camera_noise=0.0, camera_light=1.0))
    landmark = simulation.world.landmark(TAG)
    place = np.add(landmark.position_xyz, offset)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sensors.camera, "Renderer", renderer_for)
        taking = CameraSensor(settings, 0, simulation._model).measure
        image = taking(0, 0, simulation._data, place, R, motion)
    return image, landmark, place


def project(points, place, R, info):
    local = np.ascontiguousarray((points - place) @ R)
    pixels, _ = cv2.projectPoints(local, STILL, STILL, info.K, info.D)
    return pixels[:, 0]


@pytest.mark.parametrize("aside", [(0.0, 0.0), (0.7, 1.0), (-0.7, -1.1)])
@pytest.mark.usefixtures("opengl")
def test_the_lens_bends_as_its_calibration_has_it(aside):
    image, landmark, place = shoot(replace(CLEAN, **LENS), (*aside, 2.2))
    info = image.camera_info
    assert info.D.tolist() == [-0.22, 0.06, 0.002, -0.001, 0.0]
    assert image.pixels.shape == (480, 640, 3)
    expected = project(landmark.corners(), place, DOWN, info)
    found = corners_in(image)[landmark.tag_id]
    assert np.linalg.norm(found - expected, axis=1).max() < 0.5
    straight = project(landmark.corners(), place, DOWN, replace(info, D=np.zeros(5)))
    if any(aside):
        assert np.linalg.norm(straight - expected, axis=1).max() > 15


def test_a_lens_that_leaves_pixels_blind_is_one_line():
    with pytest.raises(OpenError, match="some pixels see nothing"):
        Simulation("quadrotor", "plane", settings=replace(CLEAN, camera_k1=-0.6))


@pytest.mark.parametrize(
    ("linear", "angular"),
    [((6.0, 0, 0), (0, 0, 0)), ((0, 4.0, 2.0), (0, 0, 0)), ((0, 0, 0), (0.8, 0, 1.0))],
    ids=["ahead", "aside and up", "turning"],
)
@pytest.mark.usefixtures("opengl")
def test_each_row_is_taken_at_its_own_time(linear, angular):
    readout_s = 0.03
    settings = replace(CLEAN, camera_readout=readout_s)
    image, landmark, place = shoot(
        settings, (0.5, -0.6, 2.5), motion=map(np.array, (linear, angular))
    )
    found = corners_in(image)[landmark.tag_id]
    expected = []
    for corner in landmark.corners():
        row = 239.5
        for _ in range(20):  # the row at whose time the corner is on it
            time_s = readout_s * (row / 479 - 0.5)
            turn, _ = cv2.Rodrigues(np.array(angular, float) * time_s)
            there = place + np.multiply(linear, time_s)
            pixel = project(corner[None], there, turn @ DOWN, image.camera_info)[0]
            row = pixel[1]
        expected.append(pixel)
    assert np.linalg.norm(found - expected, axis=1).max() < 0.6
    at_once = project(landmark.corners(), place, DOWN, image.camera_info)
    assert np.linalg.norm(at_once - expected, axis=1).max() > 2


@pytest.mark.usefixtures("opengl")
def test_motion_blurs_edges_by_the_way_during_the_exposure():
    speed, height, exposure_s = 4.0, 2.5, 0.02
    sharp, _, _ = shoot(CLEAN, (0, 0, height))
    east = np.array([speed, 0, 0])
    blurred, _, _ = shoot(
        replace(CLEAN, camera_exposure=exposure_s), (0, 0, height), motion=(east, STILL)
    )
    expected_px = speed * exposure_s / height * sharp.camera_info.K[0, 0]
    x, y = np.round(sharp.camera_info.K[:2, 2]).astype(int)
    widths = []
    for image in (sharp, blurred):
        window = image.pixels[y - 110 : y + 110, x - 60 : x + 60]
        slope = np.abs(np.diff(window.mean(axis=2), axis=0))  # DOWN has the east at its top
        widths.append(216 / np.sort(slope.max(axis=0))[-20:].mean())  # black to white over steepest
    assert widths[1] - widths[0] == pytest.approx(expected_px, rel=0.25)


@pytest.mark.usefixtures("opengl")
def test_a_still_camera_sees_the_same_with_any_shutter():
    plain, _, _ = shoot(CLEAN, (0.3, 0.2, 3.0))
    rolling, _, _ = shoot(
        replace(CLEAN, camera_readout=0.05, camera_exposure=0.02), (0.3, 0.2, 3.0)
    )
    assert np.abs(plain.pixels.astype(int) - rolling.pixels).mean() < 0.5


@pytest.mark.usefixtures("opengl")
def test_the_dark_costs_noise_then_brightness():
    def noise_and_mean(light):
        settings = replace(CLEAN, camera_light=light)
        noisy, clean = (
            shoot(replace(settings, camera_noise=sigma), (0, 0, 3.0))[0] for sigma in (2.0, 0.0)
        )
        off = noisy.pixels.astype(float) - clean.pixels
        return off[clean.pixels < 200].std(), clean.pixels.mean()

    (day, bright), (dusk, same), (night, dark) = map(noise_and_mean, (1.0, 0.02, 0.002))
    assert day == pytest.approx(2.0, rel=0.05)
    assert same == pytest.approx(bright, rel=0.02)  # the camera adapts
    assert dusk == pytest.approx(2.0 * math.sqrt(1 / 0.02 / 8), rel=0.05)  # 8 times the exposure
    assert dark < 0.5 * bright
    assert night == pytest.approx(8.0, rel=0.1)  # amplified 16 times


def off_tf(settings, seed=1, seconds=16.0):
    """(N, 3) degrees: attitude of the camera by the tags in its images, against truth and tf."""
    over_tags = Mission("square", size=(5.0, 4.0), center=(0.5, 1.0), height=3.5, speed=3.0, laps=0)
    simulation = Simulation("quadrotor", "field", seed, over_tags, settings)
    corners = {m.tag_id: m.corners() for m in simulation.world.landmarks if m.kind == "tag"}
    found = collect(simulation, seconds)
    truth = {m.header.stamp_ns: m for m in found["truth"]}
    moving = [t for m in found["tf"] for t in m.transforms]
    static = [t for m in found["tf_static"] for t in m.transforms]
    cameras = {t.header.stamp_ns: t for t in moving if t.child_frame_id == "camera_link"}
    fixed = next((t for t in static if t.child_frame_id == "camera_link"), None)
    angles = []
    for image in found["image"]:
        stamp = image.header.stamp_ns
        if stamp < 5e9:
            continue
        seen = {i: c for i, c in corners_in(image).items() if i in corners}
        if not seen:
            continue
        points = np.concatenate([corners[i] for i in seen])
        pixels = np.concatenate(list(seen.values())).astype(float)
        info = image.camera_info
        _, turn, _ = cv2.solvePnP(points, pixels, info.K, info.D)
        true = cv2.Rodrigues(turn)[0].T
        camera = rotations.to_matrix((fixed or cameras[stamp]).quat_xyzw)
        told = rotations.to_matrix(truth[stamp].quat_xyzw) @ camera @ OPTICAL
        angles.append(np.degrees(cv2.Rodrigues(told.T @ true)[0][:, 0]))
    return np.array(angles)


OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


@pytest.mark.usefixtures("opengl")
def test_the_frame_of_an_ideal_gimbal_is_that_of_the_images():
    angles = off_tf(CLEAN, seconds=11.0)
    assert len(angles) > 20
    assert np.median(np.abs(angles), axis=0).max() < 0.25


@pytest.mark.usefixtures("opengl")
def test_a_misaligned_camera_is_constantly_off_its_frame():
    for gimbal in (True, False):
        settings = replace(CLEAN, camera_misalignment=2.0, camera_gimbal=gimbal)
        several = [off_tf(settings, seed, 9.0) for seed in (1, 2)]
        means = np.array([np.median(one, axis=0) for one in several])
        assert np.abs(means[0] - means[1]).max() > 0.5  # by the seed
        assert 0.5 < np.sqrt((means**2).mean()) < 4
        assert (
            max(np.median(np.abs(o - m), axis=0).max() for o, m in zip(several, means, strict=True))
            < 0.4
        )


@pytest.mark.usefixtures("opengl")
def test_a_gimbal_wanders_off_its_frame_and_back():
    angles = off_tf(replace(CLEAN, gimbal_error=1.5, gimbal_error_time=0.5))
    assert np.std(angles, axis=0) == pytest.approx(np.full(3, 1.5), rel=0.5)
    assert np.abs(angles.mean(axis=0)).max() < 1.0


def test_a_lagging_gimbal_reports_old_angles():
    """On tf, the camera is where it was on the body; its true attitude on the body is level."""
    angles = {}
    for lag in (0.0, 0.1):
        settings = replace(BLIND_QUADROTOR, gimbal_lag=lag)
        mission = Mission("square", size=(6.0, 6.0), height=3.0, speed=4.0, laps=0)
        found = collect(Simulation("quadrotor", "plane", 1, mission, settings), 15.0)
        truth = {m.header.stamp_ns / 1e9: rotations.to_rpy(m.quat_xyzw) for m in found["truth"]}
        moving = [t for m in found["tf"] for t in m.transforms]
        cameras = [t for t in moving if t.child_frame_id == "camera_link"]
        rolls = [rpy[0] for rpy in truth.values()]
        for name, then_s in (("now", 0.0), ("then", 0.1)):
            at = [t.header.stamp_ns / 1e9 - then_s for t in cameras]
            roll = np.interp(at, list(truth), rolls)
            # of a level camera that looks straight down, its x axis has the body's roll
            seen = [-math.asin(rotations.to_matrix(t.quat_xyzw)[1, 0]) for t in cameras]
            angles[lag, name] = np.std(np.subtract(roll, seen)[100:])
    assert angles[0.0, "now"] < 0.2 * angles[0.0, "then"]
    assert angles[0.1, "then"] < 0.2 * angles[0.1, "now"]


def test_lagging_angles_of_a_gimbal_mix_whatever_the_signs_of_their_quaternions():
    mount = object.__new__(CameraMount)
    quat = (0.8, 0.0, 0.6, 0.0)
    mount._lag_ns = 10
    mount._angles = deque([(0, quat), (20, tuple(-one for one in quat))])
    assert mount.reported(20) == pytest.approx(quat)

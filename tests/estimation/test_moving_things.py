"""Visual odometry does not take things that move for a camera that does, nor a cut for a motion."""

import cv2
import numpy as np
import pytest
from visual_flight import HEIGHT, Flight

from ros_visualise.estimation.visual.background import MOVING_THINGS, background_rests
from ros_visualise.estimation.visual.keyframes import Keyframe
from ros_visualise.estimation.visual.odometry import VisualOdometry, VisualSettings
from ros_visualise.estimation.visual.window import KeyframeWindow

SIZE = 240, 320


def grains(seed, sigma, spread):
    noise = np.random.default_rng(seed).normal(0, 1, SIZE)
    soft = cv2.GaussianBlur(noise, (0, 0), sigma)
    return 128 + spread * soft / soft.std()


def card(number):
    """A card that fills most of the view and moves before a wall, also towards the camera."""
    near = 1 + 0.01 * number
    M = np.array([[near, 0, 2.5 * number - 20], [0, near, 1.2 * number - 8]])
    texture = cv2.warpAffine(grains(1, 2, 40), M, SIZE[::-1], borderMode=cv2.BORDER_REFLECT)
    x, y = 150 + 2.5 * number, 118 + 1.2 * number
    image = grains(0, 3, 6)
    image[int(y - 105) : int(y + 105), int(x - 100) : int(x + 100)] = texture[
        int(y - 105) : int(y + 105), int(x - 100) : int(x + 100)
    ]
    image += np.random.default_rng(number).normal(0, 1, SIZE)
    return image.clip(0, 255).astype(np.uint8)


def test_a_card_that_moves_before_a_wall_gives_no_motion():
    odometry = VisualOdometry([Flight().info])
    reasons = []
    for number in range(16):
        assert odometry.step(number * 100_000_000, card(number)) is None
        reasons.append(odometry.reason)
    assert odometry.finish() == []
    assert MOVING_THINGS in reasons


@pytest.mark.parametrize(
    ("shift", "rests"), [(0.0, True), (0.2, True), (1.5, False), (20.0, False)]
)
def test_a_background_rests_though_the_exposure_changes(shift, rests):
    wall = grains(2, 4, 30)
    M = np.array([[1, 0, shift], [0, 1, 0]])
    moved = cv2.warpAffine(wall, M, SIZE[::-1], borderMode=cv2.BORDER_REFLECT)
    darker = (0.6 * moved + 20).astype(np.uint8)
    assert background_rests(wall.astype(np.uint8), darker) == rests


def test_after_a_cut_the_camera_may_be_anywhere():
    flight = Flight()
    odometry = VisualOdometry([flight.info], None, VisualSettings(height=HEIGHT))
    for number in range(14):
        before = odometry.step(number * 100_000_000, flight.image(number))
    other = cv2.rotate(flight.image(60), cv2.ROTATE_180)
    after = odometry.step(1_400_000_000, other)
    assert "as at a cut" in odometry.reason
    assert after.is_lost
    way = np.linalg.norm(before.p)
    assert np.sqrt(np.trace(before.covariance[:3, :3])) < 0.1 * way
    assert np.sqrt(np.trace(after.covariance[:3, :3])) > 3 * way
    assert odometry.counts["losses"] == 1


def test_a_keyframe_that_fits_nothing_is_said_not_to_be_held():
    random = np.random.default_rng(4)
    points = random.uniform((-1, -1, 3), (1, 1, 6), (30, 3))
    window = KeyframeWindow(1e-3, np.eye(4)[None])
    held = []
    for key in range(4):
        p = np.array([0.2 * key, 0, 0])
        rays = (points - p)[:, :2] / points[:, 2:]
        if key == 3:
            rays = random.uniform(-1, 1, rays.shape)
        gray = np.zeros((1, 1), np.uint8)
        window.add(Keyframe(key, key, np.eye(3), p, np.arange(30), rays[None], gray))
        held.append(key == 0 or window.adjust())
    assert held == [True, True, True, False]

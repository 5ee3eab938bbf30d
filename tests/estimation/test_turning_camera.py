"""A camera that turns on the spot shows no motion, whatever is assumed about its lens."""

import cv2
import numpy as np
import pytest
from visual_flight import Flight

from ros_visualise.commands import main
from ros_visualise.estimation.visual.turning import only_turned

SIGMA = 1e-3
TURN = cv2.Rodrigues(np.array([0.05, 0.15, 0.1]))[0]


def seen(R, t, depth, widths=0.8, bend=0.0):
    """Directions (N, 2) by a lens of 0.8 widths, of points at some depths, in two views."""
    random = np.random.default_rng(0)
    rays = np.insert(random.uniform(-0.5, 0.5, (150, 2)) / widths, 2, 1.0, axis=1)
    points = rays * random.uniform(*depth, 150)[:, None]
    found = []
    for one in (points, points @ R.T + t):
        flat = one[:, :2] / one[:, 2:]
        pixels = flat * (1 - bend * (flat**2).sum(axis=1, keepdims=True)) * widths
        found.append(pixels / 0.8 + random.normal(0, SIGMA / 3, (150, 2)))
    return found


@pytest.mark.parametrize("widths", [0.5, 0.7, 1.1, 1.5])
@pytest.mark.parametrize("bend", [0.0, 0.1])
def test_a_turn_is_known_with_any_lens(widths, bend):
    assert only_turned(*seen(TURN, np.zeros(3), (1, 2), widths, bend), SIGMA, 0.8)


def test_a_turn_is_known_with_a_calibration_that_is_a_little_wrong():
    turn = seen(TURN, np.zeros(3), (1, 2), 0.76)
    assert only_turned(*turn, SIGMA)
    assert not only_turned(*seen(TURN, np.zeros(3), (1, 2), 0.4), SIGMA)


@pytest.mark.parametrize("t", [(0.3, 0, 0), (0, 0, -0.3), (0.1, 0.1, 0.1)])
def test_a_motion_is_no_turn(t):
    for R in (np.eye(3), TURN):
        assert not only_turned(*seen(R, np.array(t), (1, 4)), SIGMA)
        assert not only_turned(*seen(R, np.array(t), (1, 4)), SIGMA, 0.8)


def test_a_way_over_flat_ground_is_no_turn_with_a_calibration():
    assert not only_turned(*seen(np.eye(3), np.array([0.3, 0, 0]), (1, 1)), SIGMA)


def test_a_film_of_a_turn_without_a_calibration_is_refused(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("signal.signal", lambda *_: None)
    K = Flight().info.K
    for number in range(14):
        R = cv2.Rodrigues(np.array([0.01, 0.04, 0.01]) * number)[0]
        H = K @ R @ np.linalg.inv(K)
        picture = cv2.warpPerspective(Flight().image(0), H, (320, 240), borderMode=4)
        cv2.imwrite(str(tmp_path / f"{number:02}.png"), picture)
    assert main(["odometry", str(tmp_path)]) == 2
    assert "no trajectory in 14 images" in capsys.readouterr().err

"""Dirt, leaves, copies and clutter, by what a detector of tags finds in the images."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from test_simulated_camera import DOWN, parameters

from ros_visualise.simulation.robots.quadrotor.settings import QuadrotorParams
from ros_visualise.simulation.sensors.camera import CameraSensor
from ros_visualise.simulation.simulator import Simulation

CLEAN = replace(QuadrotorParams(), camera_noise=0.0, camera_width=800, camera_height=600)
GROUND_TAGS = {10, 11, 12, 13, 14, 15}
ABOVE = [(x, y) for x in (-6.0, -2.0, 2.0, 6.0) for y in (-4.0, 0.0, 4.0)]


@cache
def seen(seed=1, **changes):
    """Tag -> number of its views from above the middle of the field, in 12 images."""
    simulation = Simulation("quadrotor", "field", seed, settings=replace(CLEAN, **changes))
    camera = CameraSensor(simulation.settings, 0, simulation._model)
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    detector = cv2.aruco.ArucoDetector(family, parameters())
    found: dict[int, list[np.ndarray]] = {}
    for x, y in ABOVE:
        image = camera.measure(0, 0, simulation._data, np.array([x, y, 4.5]), DOWN)
        corners, ids, _ = detector.detectMarkers(cv2.cvtColor(image.pixels, cv2.COLOR_RGB2GRAY))
        for number, quad in zip(np.ravel(ids) if ids is not None else (), corners, strict=False):
            local = (quad[0].mean(axis=0) - image.camera_info.K[:2, 2]) / image.camera_info.K[0, 0]
            place = np.array([x, y]) + 4.5 * (DOWN[:2, :2] @ local)
            found.setdefault(int(number), []).append(place)
    camera.close()
    return found


@pytest.mark.usefixtures("opengl")
def test_a_new_world_shows_its_tags_and_no_others():
    found = seen()
    assert set(found) >= GROUND_TAGS
    assert max(found) < 20


@pytest.mark.usefixtures("opengl")
def test_dirt_hides_tags():
    worlds = seen(), seen(tag_dirt=0.1), seen(tag_dirt=0.5)
    views = [sum(map(len, found.values())) for found in worlds]
    assert views[0] > views[1] > views[2]
    assert views[2] < 0.5 * views[0]


@pytest.mark.usefixtures("opengl")
def test_leaves_and_branches_hide_the_declared_share_of_tags():
    hidden = [len(GROUND_TAGS - set(seen(seed, tags_covered=1.0))) for seed in (1, 2)]
    assert min(hidden) >= 4  # of 6; a leaf may leave enough of a tag
    some = GROUND_TAGS & set(seen(tags_covered=0.3))
    assert len(some) >= 2


@pytest.mark.usefixtures("opengl")
def test_copies_are_the_same_tags_elsewhere():
    found = seen(tag_copies=12)
    apart = [
        number for number, places in found.items()
        if max(np.linalg.norm(place - places[0]) for place in places) > 1.0
    ]  # fmt: skip
    assert len(apart) >= 2
    assert not [n for n, p in seen().items() if max(np.linalg.norm(q - p[0]) for q in p) > 1.0]


@pytest.mark.usefixtures("opengl")
def test_clutter_gives_false_detections_that_grow_with_it():
    """Of tags that no map has; a landmark of the world is never removed for it."""
    counts = []
    for found in (seen(), seen(clutter=10), seen(clutter=60)):
        counts.append(len([number for number in found if number >= 500]))
        assert set(found) >= GROUND_TAGS
    assert counts[0] == 0 < counts[1] < counts[2]
    assert set(seen(2, clutter=10)) != set(seen(clutter=10))

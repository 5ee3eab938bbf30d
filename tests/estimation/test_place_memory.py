"""Places are known again where they are, by as much as the covariance says, and others never."""

import cv2
import numpy as np
import visual_flight
from visual_flight import Flight

from ros_visualise.estimation.visual.place_file import MappedPlace, PlaceLook
from ros_visualise.estimation.visual.place_memory import PlaceMemory
from ros_visualise.geometry import se3

BACK = [*range(0, 40, 2), *range(37, 5, -2)]


def looked(numbers, drift=0.0, carried=None, most=500, known=()):
    """A memory, and the errors (6,) of sightings beside the first one of each place, with NEES.

    The odometry errs by ``drift`` metres an image, and is 3 m off from image ``carried`` on.
    """
    flight = Flight()
    memory, first, errors, normal = PlaceMemory(flight.info, most, known), {}, [], []
    for k, n in enumerate(numbers):
        true = se3.from_parts(flight.R(n), flight.p(n))
        off = np.eye(4)
        off[0, 3] = drift * k + 3.0 * (carried is not None and k >= carried)
        if k == carried:
            memory.interrupt()
        for one in memory.look(k, flight.image(n), off @ true):
            seen = se3.from_parts(one.R, one.t)
            expected = se3.inverse(true) @ first.setdefault(one.id, true @ seen)
            turn = se3.rotation_vector(one.R @ expected[:3, :3].T)
            errors.append(np.concatenate([one.t - expected[:3, 3], turn]))
            normal.append(errors[-1] @ np.linalg.solve(one.covariance, errors[-1]))
    return memory, np.array(errors), np.array(normal)


def test_places_measure_the_drift_of_the_odometry():
    memory, errors, normal = looked(BACK, drift=0.01)
    assert memory.counts["recognized"] >= 3
    assert np.linalg.norm(errors[:, :3], axis=1).max() < 0.15  # the odometry is off by 0.3 m
    assert normal.mean() < 6
    assert normal.max() < 22


def test_a_robot_that_was_carried_away_knows_its_place():
    memory, errors, _ = looked(BACK, carried=20)
    assert memory.counts["recognized"] >= 2
    assert np.linalg.norm(errors[:, :3], axis=1).max() < 0.15


def test_a_straight_flight_comes_to_no_place_again():
    memory, errors, _ = looked(range(0, 60, 3))
    assert memory.counts["recognized"] == 0
    assert memory.counts["places"] >= 3
    assert len(errors) == memory.counts["places"]  # the first sighting of each, which is exact
    assert np.abs(errors).max() < 1e-9


def test_a_pattern_that_repeats_is_no_place_even_after_a_loss(monkeypatch):
    tile = cv2.GaussianBlur(visual_flight._texture()[:120, :120], (0, 0), 1)  # 2 m
    tiled = np.tile(tile, (8, 10))[:960, :1200]
    monkeypatch.setattr(visual_flight, "_texture", lambda: tiled)
    memory, errors, _ = looked([*range(0, 45, 3), *range(6, 30, 3)], carried=15)
    assert memory.counts["ambiguous"] + memory.counts["too far"] > 3
    assert np.linalg.norm(errors[:, :3], axis=1).max() < 0.15


def test_the_memory_is_bounded():
    memory, _, _ = looked(range(0, 60, 3), most=2)
    assert memory.counts["places"] > 2
    assert len(memory) == 2


def test_new_places_leave_those_of_a_map():
    known = [MappedPlace(look(seed), np.eye(4)) for seed in range(4)]  # all at one point
    memory, _, _ = looked(range(0, 60, 3), most=2, known=known)
    assert memory.counts["places"] > 2
    assert [one.id for one in memory.looks[:4]] == [one.look.id for one in known]
    assert len(memory) == 6


def look(seed):
    """A place that no image shows."""
    random = np.random.default_rng(seed)
    descriptors = random.integers(0, 256, (60, 32), dtype=np.uint8)
    return PlaceLook(descriptors, random.normal(0, 0.3, (60, 2)), np.ones(60))


def test_images_without_features_are_no_views():
    memory = PlaceMemory(Flight().info)
    for k in range(3):
        assert memory.look(k, np.full((240, 320), 90, np.uint8), np.eye(4)) == []
    assert memory.counts["views"] == 0

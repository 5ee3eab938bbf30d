"""Images are known again, turned and in other light, among others like them."""

import cv2
import numpy as np
import pytest

from ros_visualise.sources.flyover import draw_landscape
from ros_visualise.vision.places import PlaceFeatures, PlaceIndex, find_features, match_features


@pytest.fixture(scope="module")
def views():
    """Twelve places of a landscape, gray (240, 320)."""
    gray = cv2.cvtColor(draw_landscape(), cv2.COLOR_BGR2GRAY)
    return [gray[y : y + 240, x : x + 320] for y in (300, 900, 1500) for x in range(200, 2200, 500)]


def seen_later(view):
    """A place from another height, turned, darker, with noise."""
    turned = cv2.getRotationMatrix2D((160, 120), 25, 0.9)
    later = cv2.warpAffine(view, turned, (320, 240), borderMode=cv2.BORDER_REFLECT)
    noise = np.random.default_rng(1).normal(0, 6, later.shape)
    return np.clip(0.7 * later + noise, 0, 255).astype(np.uint8)


def test_places_are_found_again(views):
    index = PlaceIndex()
    assert [index.add(find_features(view)) for view in views] == list(range(12))
    for number, view in enumerate(views):
        later = find_features(seen_later(view))
        assert index.find(later, 12, 3)[0] == number
        assert number not in index.find(later, number, 12)


def test_nothing_is_like_an_empty_image(views):
    empty = find_features(np.full((240, 320), 90, np.uint8))
    index = PlaceIndex()
    index.add(empty)
    index.add(find_features(views[0]))
    assert len(empty.pixels_uv) == 0
    assert index.find(empty, 2, 5) == []
    assert index.find(find_features(views[0]), 0, 5) == []
    assert match_features(empty, find_features(views[0])).shape == (0, 2)


def test_features_match_where_the_image_was_turned_to(views):
    first, second = find_features(views[5]), find_features(seen_later(views[5]))
    pairs = match_features(first, second)
    turned = cv2.getRotationMatrix2D((160, 120), 25, 0.9)
    there = np.insert(first.pixels_uv[pairs[:, 0]], 2, 1, axis=1) @ turned.T
    off = np.linalg.norm(there - second.pixels_uv[pairs[:, 1]], axis=1)
    assert len(pairs) > 60
    assert (off < 3).mean() > 0.7
    assert len(np.unique(pairs[:, 1])) == len(pairs)


def test_what_every_image_shows_tells_nothing(views):
    common = find_features(views[0])
    index = PlaceIndex()
    for _ in range(120):
        index.add(common)
    assert index.find(common, 120, 5) == []
    own = np.random.default_rng(2).integers(0, 256, (300, 32), np.uint8)
    number = index.add(PlaceFeatures(np.zeros((300, 2)), np.concatenate([own])))
    seen = PlaceFeatures(np.zeros((600, 2)), np.concatenate([own, common.descriptors[:300]]))
    assert index.find(seen, 121, 5) == [number]

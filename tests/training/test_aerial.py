"""The network that is shipped, on worlds of styles that it was not trained on and on photos."""

import cv2
import numpy as np
import pytest
from metrics import iou
from pictures import render_world
from worlds import CLASSES

from ros_visualise.landmarks.networks.candidates import SelectionRules
from ros_visualise.nodes.landmark_detector import OWN_MODEL

pytest.importorskip("mujoco")
pytest.importorskip("onnxruntime", reason="pip install 'ros_visualise[detect]' to run this")

from ros_visualise.landmarks.networks.network import Network
from ros_visualise.landmarks.networks.tiles import detect_in_tiles

_LEAST_PX = 32
_HELIPAD = CLASSES.index("helipad")


@pytest.fixture(scope="module")
def network():
    return Network(str(OWN_MODEL))


@pytest.fixture(scope="module")
def views(opengl):
    """Pictures of styles that it was not trained on, and what is to be seen in them."""
    return [some[:2] for some in render_world((77, 0), 40, (640, 480), held_out=True)]


@pytest.fixture(scope="module")
def matched(network, views):
    """For each landmark that is large and all in view: what it is, and what was found of it."""
    pairs = []
    for picture, seen in views:
        found = network.detect(picture, "RGB", SelectionRules(min_score=0.3))
        for one in seen:
            if one.share > 0.95 and (one.box[2:] - one.box[:2]).max() >= _LEAST_PX:
                mine = found.take(found.classes == one.kind)
                pairs.append((one, mine.take(iou(one.box, mine.boxes_xyxy) > 0.5)))
    return pairs


def test_the_file_tells_what_it_is(network):
    assert network.layout.name == "ros_visualise"
    assert tuple(network.names.values()) == CLASSES
    assert {"license", "version", "seed", "stride"} <= set(network.metadata)
    assert OWN_MODEL.stat().st_size < 5e6


def test_it_finds_what_it_never_saw(matched):
    assert len(matched) > 20
    assert np.mean([len(good) > 0 for _, good in matched]) > 0.7


def test_what_is_not_wanted_changes_nothing_else(network, views):
    """Who wants sure things alone gets those that all others would get, too."""
    count = 0
    for picture, _ in views[:8]:
        every = network.detect(picture, "RGB", SelectionRules(min_score=0.02))
        sure = network.detect(picture, "RGB", SelectionRules(min_score=0.6))
        among = every.take(every.scores >= 0.6)
        np.testing.assert_allclose(sure.boxes_xyxy, among.boxes_xyxy, atol=0.01)
        np.testing.assert_allclose(sure.scores, among.scores, atol=1e-4)
        count += len(every) - len(sure)
    assert count > 20


def test_points_of_pads_and_tags_are_where_their_variances_say(matched):
    kinds = _HELIPAD, CLASSES.index("tag")
    errors, squares = [], []
    for one, good in matched:
        if len(good) and one.kind in kinds:
            gap = good.points_uv[0] - one.point
            errors.append(np.linalg.norm(gap) / (one.box[2:] - one.box[:2]).max())
            squares.append(gap @ np.linalg.inv(good.covariances[0]) @ gap / 2)
    assert len(errors) > 8
    assert np.median(errors) < 0.06
    assert np.mean(squares) < 2


def test_real_helipads_are_found(network, recordings):
    photos = sorted((recordings / "helipad" / "photos").glob("*.txt"))[::6]
    found = []
    for path in photos:
        picture = cv2.imread(str(path.with_suffix(".jpg")))
        size = np.array(picture.shape[1::-1])
        x, y, w, h = np.loadtxt(path, ndmin=2)[0, 1:5]
        box = np.array([x - w / 2, y - h / 2, x + w / 2, y + h / 2]) * np.tile(size, 2) - 0.5
        mine = network.detect(picture, "BGR", SelectionRules(min_score=0.4))
        mine = mine.take(mine.classes == _HELIPAD)
        found.append((iou(box, mine.boxes_xyxy) > 0.5).any())
    assert len(photos) > 8
    assert np.mean(found) > 0.9


def test_it_finds_nothing_on_plain_ground(network):
    random = np.random.default_rng(0)
    for level in (0, 80, 160, 255):
        picture = np.clip(random.normal(level, 6, (480, 640, 3)), 0, 255).astype(np.uint8)
        assert len(network.detect(picture, "RGB", SelectionRules(min_score=0.4))) == 0


def test_tiles_find_more_in_4k_pictures(network, opengl):
    found = dict.fromkeys((0, 640), 0)
    for picture, seen, _ in render_world((4000, 0), 2, (3840, 2160)):
        for side in found:
            some = detect_in_tiles(network, picture, "RGB", SelectionRules(min_score=0.4), side)
            for one in (each for each in seen if each.share > 0.5):
                same = some.boxes_xyxy[some.classes == one.kind]
                found[side] += bool((iou(one.box, same) > 0.5).any())
    assert found[640] > found[0]

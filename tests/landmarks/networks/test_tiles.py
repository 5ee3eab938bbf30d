"""Detection in tiles: found once, where it is, whatever the seams; on 4K pictures, too."""

import cv2
import numpy as np
import pytest

from ros_visualise.landmarks.networks import tiles
from ros_visualise.landmarks.networks.candidates import Candidates, SelectionRules
from ros_visualise.nodes.landmark_detector import OWN_MODEL

ALL = SelectionRules(min_score=0.1, max_overlap=0.5)
SIZES = [(3840, 2160), (4000, 2250), (1920, 1080), (700, 641), (641, 300), (5000, 400)]


class Blobs:
    """A detector of its own: bright blobs larger than a hundredth of the image it gets.

    Its score is smaller where a blob is small in that image, as that of networks.
    """

    def __init__(self):
        self.calls = 0

    def detect(self, pixels, order, choice):
        self.calls += 1
        _, _, stats, _ = cv2.connectedComponentsWithStats((pixels > 127).astype(np.uint8))
        boxes = stats[1:, :4].astype(float)
        share = boxes[:, 2:].max(axis=1) / max(pixels.shape)
        boxes = np.hstack([boxes[:, :2], boxes[:, :2] + boxes[:, 2:]]) - 0.5
        middles = (boxes[:, :2] + boxes[:, 2:]) / 2
        found = Candidates(
            boxes, np.minimum(0.3 + share, 1), np.zeros(len(boxes), int), middles,
            np.tile(np.eye(2), (len(boxes), 1, 1)),
        )  # fmt: skip
        return found.take(share > 0.01)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("side", [300, 640])
def test_tiles_cover_the_image_and_overlap_by_what_is_promised(size, side):
    covered = np.zeros(size[::-1], int)
    found = tiles.tiles_of(size, side)
    for left, top, right, bottom in found:
        assert 0 <= left < right <= size[0]
        assert 0 <= top < bottom <= size[1]
        assert right - left == min(side, size[0])
        assert bottom - top == min(side, size[1])
        covered[top:bottom, left:right] += 1
    assert covered.min() == 1
    for axis in (0, 1):
        starts = sorted({tile[axis] for tile in found})
        assert (np.diff(starts) <= side - tiles.OVERLAP * side).all()


@pytest.mark.parametrize("seed", range(5))
def test_what_is_anywhere_is_found_once_and_in_its_place(seed):
    random = np.random.default_rng(seed)
    image = np.zeros((2160, 3840), np.uint8)
    true = []
    for column in range(8):
        for row in range(4):
            w, h = random.integers(20, 127, 2)
            x, y = random.integers((480 * column + 5, 540 * row + 5), 350 + np.array(
                (480 * column, 540 * row)))  # fmt: skip
            image[y : y + h, x : x + w] = 255
            true.append([x - 0.5, y - 0.5, x + w - 0.5, y + h - 0.5])
    found = tiles.detect_in_tiles(Blobs(), image, "BGR", ALL, 640)
    assert sorted(found.boxes_xyxy.tolist()) == sorted(true)
    assert found.points_uv == pytest.approx((found.boxes_xyxy[:, :2] + found.boxes_xyxy[:, 2:]) / 2)


def test_what_is_larger_than_a_tile_is_found_once_in_the_whole_image():
    image = np.zeros((2160, 3840), np.uint8)
    image[300:1700, 900:2600] = 255
    found = tiles.detect_in_tiles(Blobs(), image, "BGR", ALL, 640)
    assert found.boxes_xyxy.tolist() == [[899.5, 299.5, 2599.5, 1699.5]]


def test_what_touches_the_edge_of_the_image_stays():
    image = np.zeros((2160, 3840), np.uint8)
    image[2100:, 3780:] = image[:50, :60] = 255
    found = tiles.detect_in_tiles(Blobs(), image, "BGR", ALL, 640)
    assert len(found) == 2


@pytest.mark.parametrize("side", [0, 3840, 4096])
def test_without_tiles_the_image_is_looked_at_once(side):
    detector = Blobs()
    tiles.detect_in_tiles(detector, np.zeros((2160, 3840), np.uint8), "BGR", ALL, side)
    assert detector.calls == 1


def real_4k(recordings):
    """A photographed beach, with a photographed helipad of 50 pixels pasted at a seam of tiles."""
    beach = cv2.imread(str(recordings / "video" / "DJI_0020.JPG"))
    photo = cv2.imread(str(recordings / "helipad" / "photos" / "img_010.jpg"))
    numbers = np.loadtxt(recordings / "helipad" / "photos" / "img_010.txt", ndmin=2)[0]
    size = np.tile(photo.shape[1::-1], 2)
    x, y, w, h = np.round(numbers[1:5] * size).astype(int)
    part = photo[max(y - h // 2, 0) : y + h // 2, max(x - w // 2, 0) : x + w // 2]
    pad = cv2.resize(part, (50, 50 * part.shape[0] // part.shape[1]), interpolation=cv2.INTER_AREA)
    at = np.array([2990, 1020])
    beach[at[1] : at[1] + pad.shape[0], at[0] : at[0] + pad.shape[1]] = pad
    return beach, at - 0.5 + np.array([pad.shape[1], pad.shape[0]]) / 2


def test_a_small_real_helipad_in_a_real_4k_picture_is_found_by_tiles_alone(recordings):
    pytest.importorskip("onnxruntime")
    from ros_visualise.landmarks.networks.network import Network

    network = Network(str(OWN_MODEL))
    picture, middle = real_4k(recordings)
    rules = SelectionRules(0.4, 0.5, 100, frozenset({0}))
    assert len(tiles.detect_in_tiles(network, picture, "BGR", rules, 0)) == 0
    found = tiles.detect_in_tiles(network, picture, "BGR", rules, 640)
    gaps = np.linalg.norm(found.boxes_xyxy.reshape(-1, 2, 2).mean(axis=1) - middle, axis=1)
    assert (gaps < 8).sum() == 1

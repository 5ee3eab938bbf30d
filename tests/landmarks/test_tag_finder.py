"""Tags are found with their ids, their corners in order and to a fraction of a pixel."""

import json

import cv2
import drawn_tags
import numpy as np
import pytest

from ros_visualise.core.errors import ParameterError
from ros_visualise.data import CameraInfo
from ros_visualise.landmarks.tags import TagFinder, draw_cells, family, parse_families
from ros_visualise.landmarks.tags.finder import clearness
from ros_visualise.landmarks.tags.fitting import fit_tags

FAMILIES = ("tag36h11", "tag25h9", "tag16h5", "tagStandard41h12", "tagStandard52h13")
DICTIONARIES = ("4x4_50", "5x5_1000", "6x6_250", "7x7_100", "aruco_original")
ALL = (
    *FAMILIES,
    *("4x4_1000", "5x5_1000", "6x6_1000", "7x7_1000", "aruco_original", "aruco_mip_36h12"),
)


@pytest.mark.parametrize("name", [*FAMILIES, *DICTIONARIES])
def test_corners_go_anticlockwise_from_the_lower_left_of_the_printed_tag(name):
    """The picture's pixels 30 to 29 + side are the square: its edges lie at 29.5 and so on."""
    cells, rim = draw_cells(family(name), 7)
    picture = np.pad(np.kron(cells * 190 + 30, np.ones((10, 10), np.uint8)), 30)
    picture[:30], picture[-30:], picture[:, :30], picture[:, -30:] = 128, 128, 128, 128
    low, high = 29.5 + 10 * rim, 29.5 + 10 * (len(cells) - rim)
    upright = np.array([[low, high], [high, high], [high, low], [low, low]])
    for turns in range(4):
        (tag,) = TagFinder([family(name)]).find(np.rot90(picture, turns).copy())
        assert (tag.family, tag.id, tag.hamming) == (family(name).name, 7, 0)
        last = len(picture) - 1
        expected = upright
        for _ in range(turns):
            expected = np.column_stack([expected[:, 1], last - expected[:, 0]])
        np.testing.assert_allclose(tag.corners_uv, expected, atol=0.03)
        np.testing.assert_allclose(tag.center_uv, (low + high) / 2, atol=0.02)


@pytest.mark.parametrize(("side", "median"), [(20, 0.07), (32, 0.025), (64, 0.015)])
@pytest.mark.parametrize("name", ["tag36h11", "5x5_1000"])
def test_corners_are_near_to_the_truth(name, side, median):
    finder, rng = TagFinder([family(name)]), np.random.default_rng(7)
    errors = []
    for id in range(30):
        cells, rim = draw_cells(family(name), id)
        picture, truth = drawn_tags.side_to_side(cells, rim, rng, side)
        (tag,) = finder.find(picture)
        assert tag.id == id
        errors.append(np.linalg.norm(tag.corners_uv - truth, axis=1))
    assert np.median(errors) < median


def test_what_does_not_look_like_the_tag_keeps_its_corners():
    cells, rim = draw_cells(family("tag36h11"), 7)
    corners = np.array([[[10.0, 50], [50, 50], [50, 10], [10, 10]]])
    noise = np.random.default_rng(1).integers(0, 255, (60, 60), np.uint8)
    for gray in (np.full((60, 60), 90, np.uint8), noise):
        found, spread = fit_tags(gray, corners, cells[None], rim)
        assert (found == corners).all()
        assert np.isnan(spread).all()
    assert fit_tags(noise, np.zeros((0, 4, 2)), np.zeros((0, *cells.shape)), rim)[0].size == 0


@pytest.mark.parametrize(("side", "tilt", "gamma"), [(16, 0.3, 1), (30, 1.0, 1), (60, 0.3, 2.2)])
def test_corners_are_fitted_from_where_they_are_nearly(side, tilt, gamma):
    """Whatever the camera makes of the light: a curve of the levels makes white wider."""
    (cells, rim), rng = draw_cells(family("tag36h11"), 3), np.random.default_rng(2)
    off, told = [], []
    for _ in range(20):
        picture, truth = drawn_tags.side_to_side(cells, rim, rng, side, tilt)
        curved = np.round(255 * (picture / 255.0) ** (1 / gamma)).astype(np.uint8)
        near = truth + rng.uniform(-0.5, 0.5, (1, 4, 2))
        found, spread = fit_tags(curved, near, cells[None], rim)
        error = (found[0] - truth).ravel()
        off.append(error)
        told.append(error @ np.linalg.solve(spread[0], error))
    assert np.median(np.abs(off)) < 0.025
    assert np.abs(off).max() < 0.15
    assert 4 < np.mean(told) < 12, "8, as 8 numbers have it"


def test_tags_seen_from_the_side_are_found():
    finder, rng = TagFinder([family("tag36h11")]), np.random.default_rng(3)
    for id in range(20):
        picture, truth = drawn_tags.side_to_side(*draw_cells(family("36h11"), id), rng, 40, 0.9)
        (tag,) = finder.find(picture)
        assert tag.id == id
        assert np.linalg.norm(tag.corners_uv - truth, axis=1).max() < 0.4


def test_tags_in_regions_are_those_of_the_whole_image():
    rng = np.random.default_rng(5)
    image = np.full((300, 400), 128, np.uint8)
    for id, (left, top) in enumerate([(20, 20), (250, 150)]):
        part, _ = drawn_tags.side_to_side(*draw_cells(family("36h11"), id), rng, 50)
        image[top : top + len(part), left : left + len(part)] = part
    finder = TagFinder([family("36h11")])
    whole = finder.find(image)
    parts = finder.find(image, [(16, 16, 150, 150), (240, 144, 400, 300)])
    assert [tag.id for tag in whole] == [tag.id for tag in parts] == [0, 1]
    for one, other in zip(whole, parts, strict=True):
        np.testing.assert_allclose(one.corners_uv, other.corners_uv, atol=0.05)
    (only,) = finder.find(image, [(240, 144, 400, 300)])
    assert only.id == 1


def test_families_are_named_in_several_ways():
    names = "36h11 tag25h9, tagStandard41h12;DICT_5X5_1000 5x5_1000 DICT_APRILTAG_16h5"
    found = [one.name for one in parse_families(names)]
    assert found == ["tag36h11", "tag25h9", "tagStandard41h12", "5x5_1000", "tag16h5"]


@pytest.mark.parametrize(("text", "said"), [("36h12", "'36h12'; choose from tag36h11"), ("", "''")])
def test_a_family_that_is_not_there_is_refused(text, said):
    with pytest.raises(ParameterError, match=f"no such tag family: {said}"):
        parse_families(text)


def test_a_tag_that_a_family_has_not_is_refused():
    with pytest.raises(ParameterError, match="no tag 30 in tag16h5: choose from 0 to 29"):
        draw_cells(family("tag16h5"), 30)


@pytest.mark.parametrize("shape", [(1, 1), (15, 400), (16, 16), (17, 999), (3, 3)])
def test_an_image_too_small_for_a_tag_has_none(shape):
    assert TagFinder([family("36h11")]).find(np.zeros(shape, np.uint8)) == ()


def test_photos_show_the_tags_that_are_in_them(recordings):
    folder = recordings / "tags" / "swatbotics"
    finder = TagFinder([family("36h11")])
    for line in (folder / "groundtruth.txt").read_text().splitlines():
        name, *ids = line.split()
        if not (folder / name).exists():
            continue
        gray = cv2.imread(str(folder / name), cv2.IMREAD_GRAYSCALE)
        assert [tag.id for tag in finder.find(gray)] == sorted(map(int, ids)), name


def test_a_photo_of_an_aruco_tag(recordings):
    """The corners beside it were given by OpenCV, and its calibration with them."""
    path = recordings / "tags" / "fiducials" / "tag_01_d7_14cm.png"
    K = np.array([[1006.126, 0, 655.864], [0, 1004.015, 490.614], [0, 0, 1]])
    info = CameraInfo(960, 1280, K, np.array([0.13497, -0.23359, 0.00067, 0.00485, 0]))
    gray = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    (tag,) = TagFinder([family("5x5_1000")]).find(gray, info=info)
    given = [(565.753, 409.245), (767.959, 415.378), (777.426, 206.850), (569.899, 201.559)]
    assert tag.name == "5x5_1000_1"
    assert np.linalg.norm(tag.corners_uv - given, axis=1).max() < 0.5


def test_pictures_without_tags_show_none_of_any_family(recordings):
    finder = TagFinder([family(name) for name in ALL])
    video = cv2.VideoCapture(str(recordings / "video" / "vtest.avi"))
    for number in range(400):
        _, frame = video.read()
        if number % 40 == 0:
            assert finder.find(cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)) == ()


def test_aruco_tags_are_the_same_on_the_systems_opencv(tmp_path, run_on_system_opencv):
    """4.6 has none of the calls by which later ones find tags."""
    wanted = {}
    for name in DICTIONARIES:
        picture, _ = drawn_tags.side_to_side(
            *draw_cells(family(name), 11), np.random.default_rng(2), 60
        )
        cv2.imwrite(str(tmp_path / f"{name}.png"), picture)
        (tag,) = TagFinder([family(name)]).find(picture)
        wanted[tag.name] = tag.corners_uv
    code = f"""
import cv2, json
from ros_visualise.landmarks.tags import TagFinder, family
found = {{}}
for name in {DICTIONARIES!r}:
    gray = cv2.imread("{tmp_path}/" + name + ".png", cv2.IMREAD_GRAYSCALE)
    found |= {{tag.name: tag.corners_uv.tolist() for tag in TagFinder([family(name)]).find(gray)}}
print(json.dumps(found))
"""
    found = json.loads(run_on_system_opencv(code))
    assert list(found) == list(wanted)
    for name, corners in wanted.items():  # the versions interpolate differently
        np.testing.assert_allclose(found[name], corners, atol=0.02)


def test_clearness_tells_how_alike_cells_of_one_colour_are():
    cells, rim = draw_cells(family("4x4_50"), 5)
    picture = np.kron(cells * 200 + 20, np.ones((9, 9), np.uint8)).astype(np.uint8)
    low, high = 9 * rim - 0.5, 9 * (len(cells) - rim) - 0.5
    corners = np.array([[low, high], [high, high], [high, low], [low, low]])
    assert clearness(picture, corners, 6) == pytest.approx(1)
    stained = picture.copy()
    stained[9 * rim : 9 * (rim + 1), 27:36] = 120  # half as bright as white, in the black rim
    assert clearness(stained, corners, 6) == pytest.approx(0.5, abs=0.1)
    assert clearness(np.full_like(picture, 7), corners, 6) == -1


@pytest.mark.parametrize("name", ["4x4_50", "tag16h5", "aruco_original"])
def test_small_families_are_found_where_their_cells_can_be_seen(name):
    finder, rng = TagFinder([family(name)]), np.random.default_rng(4)
    for id in range(20):
        picture, _ = drawn_tags.side_to_side(*draw_cells(family(name), id), rng, 20)
        assert [tag.id for tag in finder.find(picture)] == [id]


def test_faint_tags_are_found_as_far_as_their_family_accepts_them():
    """Eleven levels between black and white: just more than twice the margin of the family."""
    finder, rng = TagFinder([family("36h11")]), np.random.default_rng(6)
    for id in range(20):
        picture, _ = drawn_tags.side_to_side(*draw_cells(family("36h11"), id), rng, 32)
        faint = (100 + (picture - 30.0) / 190 * 11).round().astype(np.uint8)
        assert [tag.id for tag in finder.find(faint)] == [id]
    assert TagFinder([family("36h11")], min_margin=10).find(faint) == ()

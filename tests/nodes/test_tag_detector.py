"""The node that finds tags: what it says of every kind of image, calibrated or not."""

import logging
import re
from dataclasses import fields, replace

import cv2
import drawn_tags
import numpy as np
import pytest

from ros_visualise.core.errors import OpenError, ParameterError, UnsupportedImage
from ros_visualise.core.params import update
from ros_visualise.data import CameraInfo, Header, Image
from ros_visualise.landmarks.tags import draw_cells, family
from ros_visualise.nodes.tag_detector import TagDetector, TagParams
from ros_visualise.sources.calibration import to_yaml

SIZE = (320, 240)
K = np.array([[300.0, 0, 160], [0, 300, 120], [0, 0, 1]])
INFO = CameraInfo(240, 320, K)
SIDE = 0.2
T = np.array([0.1, -0.05, 1.2])
R = cv2.Rodrigues(np.array([0.5, -0.4, 0.2]))[0] @ np.diag([1.0, -1, -1])  # towards the camera


def corners_in(info, points):
    """Pixels of points of the tag's frame, as a camera with that calibration sees them."""
    seen = points @ R.T + T
    if info.distortion_model == "equidistant":
        found = cv2.fisheye.projectPoints(seen[None], np.zeros(3), np.zeros(3), info.K, info.D)[0]
    else:
        found = cv2.projectPoints(seen, np.zeros(3), np.zeros(3), info.K, info.D)[0]
    return found.reshape(-1, 2)


def square(size=SIDE, x=0.0):
    half = size / 2
    corners = np.array([[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]])
    return corners + np.array([x, 0, 0])


def picture(info=INFO, ids=(3,)):
    """Tags side by side in one plane; between their corners the lens is taken for straight."""
    image = np.full(SIZE[::-1], 128, np.uint8)
    for number, id in enumerate(ids):
        corners = corners_in(info, square(x=0.35 * number - 0.1))
        drawn = drawn_tags.draw(
            *draw_cells(family("36h11"), id), corners, SIZE, np.random.default_rng(id)
        )
        part = cv2.boundingRect((corners.mean(0) + 1.4 * (corners - corners.mean(0))).astype(int))
        x, y, w, h = part
        image[y : y + h, x : x + w] = drawn[y : y + h, x : x + w]
    return Image(image, "mono8", Header(5, "camera"), info)


def detect(image, **changes):
    params = update(TagParams(), {"size": SIDE, **changes})
    return TagDetector(params).step(image, params)


def found_in(image, **changes):
    return detect(image, **changes)["detections"]


FISHEYE = replace(INFO, D=np.array([0.05, -0.02, 0.0, 0.0]), distortion_model="equidistant")
BENT = replace(INFO, D=np.array([-0.2, 0.05, 0.001, -0.001, 0.0]))


@pytest.mark.parametrize("info", [INFO, BENT, FISHEYE], ids=["straight", "bent", "fisheye"])
def test_a_tag_is_found_where_it_is(info):
    image = picture(info)
    found = found_in(image)
    assert found.header == image.header
    assert found.camera_info is info
    (one,) = found.detections
    expected = corners_in(info, square(x=-0.1))
    assert (one.class_id, one.id, one.hypotheses[0].number) == ("tag36h11_3", "3", 3)
    np.testing.assert_allclose(one.corners_uv, expected, atol=0.15)
    best = one.hypotheses[0]
    np.testing.assert_allclose(best.position_xyz, T + R @ [-0.1, 0, 0], atol=0.02)
    assert np.linalg.eigvalsh(best.covariance).min() > 0
    assert best.score == max(each.score for each in one.hypotheses)


def test_without_a_calibration_there_are_corners_alone():
    (one,) = found_in(replace(picture(), camera_info=None)).detections
    assert len(one.corners_uv) == 4
    (hypothesis,) = one.hypotheses
    assert not hypothesis.covariance.any()
    assert TagDetector.declared.calibrated  # so that it is said, once


@pytest.mark.parametrize(
    ("info", "said"),
    [
        (
            replace(INFO, width=640),
            "no poses: images are 320x240, their calibration is for 640x240",
        ),
        (CameraInfo.uncalibrated(240, 320), "no poses: the camera is not calibrated"),
        (replace(INFO, distortion_model="magic", D=np.ones(3)), "no poses: .*magic"),
    ],
)
def test_a_calibration_that_does_not_fit_is_said_once(caplog, info, said):
    params = update(TagParams(), {"size": SIDE})
    node = TagDetector(params)
    with caplog.at_level(logging.WARNING):
        for _ in range(2):
            (one,) = node.step(replace(picture(), camera_info=info), params)[
                "detections"
            ].detections
            assert not one.hypotheses[0].covariance.any()
    (record,) = caplog.records
    assert re.search(said, record.getMessage())


def test_a_tag_of_unknown_size_has_no_pose_and_that_is_said(caplog):
    (one,) = found_in(picture(), size=0).detections
    assert not one.hypotheses[0].covariance.any()
    assert f"no poses for tags of unknown size ({one.class_id}): set size" in caplog.text


def test_a_bundle_is_one_detection_of_its_name(tmp_path):
    path = tmp_path / "tags.yaml"
    path.write_text(
        f"tag_bundles: [{{name: board, layout: [{{id: 3, size: {SIDE}, x: -0.1}},"
        f" {{id: 4, size: {SIDE}, x: 0.25}}]}}]"
    )
    (one,) = found_in(picture(ids=(3, 4)), tags=str(path)).detections
    best = one.hypotheses[0]
    assert (one.class_id, one.id, best.number) == ("board", "board", 3)
    np.testing.assert_allclose(best.position_xyz, T, atol=0.01)
    assert not len(one.corners_uv)
    uncalibrated = replace(picture(ids=(3, 4)), camera_info=None)
    alone = found_in(uncalibrated, tags=str(path)).detections
    assert [each.class_id for each in alone] == ["tag36h11_3", "tag36h11_4"]


def test_sizes_and_names_are_those_of_the_file(tmp_path):
    path = tmp_path / "tags.yaml"
    path.write_text("standalone_tags: [{id: 3, size: 0.4, name: dock}]")
    (one,) = found_in(picture(), tags=str(path)).detections
    assert one.class_id == "dock"
    twice = 2 * (T + R @ [-0.1, 0, 0])  # it looks as one of half the size at half the distance
    np.testing.assert_allclose(one.hypotheses[0].position_xyz, twice, atol=0.04)


@pytest.mark.parametrize("encoding", ["mono16", "bgr8", "rgb8", "bgra8", "rgb16", "bayer_rggb8"])
def test_images_of_all_kinds_show_the_same_tags(encoding):
    gray = picture().pixels
    channels = {"bgr8": 3, "rgb8": 3, "rgb16": 3, "bgra8": 4}.get(encoding, 1)
    pixels = np.dstack([gray] * channels) if channels > 1 else gray
    if encoding.endswith("16"):
        pixels = pixels.astype(np.uint16) * 257
    (one,) = found_in(replace(picture(), data=pixels, encoding=encoding)).detections
    assert one.class_id == "tag36h11_3"
    np.testing.assert_allclose(one.corners_uv, corners_in(INFO, square(x=-0.1)), atol=0.3)


def test_depth_is_refused():
    with pytest.raises(UnsupportedImage, match="32FC1 holds measurements"):
        detect(Image(np.ones(SIZE[::-1], np.float32), "32FC1"))


def test_the_picture_with_tags_is_drawn_when_it_is_looked_at():
    image = picture()
    shown = detect(image)["debug_image"]
    assert TagDetector.declared.on_demand == {"debug_image"}
    assert (shown.encoding, shown.header, shown.height, shown.width) == (
        "bgr8",
        image.header,
        240,
        320,
    )
    changed = (shown.pixels != image.pixels[..., None]).any(axis=2)
    low, high = corners_in(INFO, square(x=-0.1))[[0, 2]].round().astype(int)
    for x, y in (low, high):
        assert changed[y - 2 : y + 3, x - 2 : x + 3].any()
    assert not changed[:20].any()


def test_parameters_may_change_while_it_runs():
    node, image = TagDetector(TagParams()), picture()
    assert (
        node.step(image, update(TagParams(), {"families": "16h5"}))["detections"].detections == ()
    )
    both = update(TagParams(), {"families": "16h5 36h11", "search_every": 3})
    for _ in range(4):
        assert len(node.step(image, both)["detections"].detections) == 1


def test_what_cannot_be_is_refused_when_it_begins(tmp_path):
    with pytest.raises(ParameterError, match="no such tag family: 'x'; choose from tag36h11"):
        TagDetector(TagParams(families="x"))
    with pytest.raises(OpenError, match="no such file"):
        TagDetector(TagParams(tags=str(tmp_path / "none.yaml")))


def test_the_uncertainty_of_a_calibration_file_is_that_of_the_poses(tmp_path):
    path, covariance = tmp_path / "camera.yaml", np.diag([36.0, 36.0, 1.0, 1.0])
    path.write_text(to_yaml(replace(INFO, D=np.zeros(0)), "camera", covariance))
    image = picture()
    plain, given, by_hand = (
        found_in(image, **changes).detections[0].hypotheses[0]
        for changes in ({}, {"calibration": str(path)}, {"focal_sigma": 2, "center_sigma": 1})
    )
    assert np.trace(given.covariance[:3, :3]) > 4 * np.trace(plain.covariance[:3, :3])
    np.testing.assert_allclose(given.covariance, by_hand.covariance)


def test_a_calibration_without_uncertainty_is_refused_at_once(tmp_path):
    path = tmp_path / "camera.yaml"
    path.write_text(to_yaml(INFO, "camera"))
    with pytest.raises(ParameterError, match=r"calibration=.*no intrinsics_covariance"):
        update(TagParams(), {"calibration": str(path)})


def test_parameters_hold_nothing_but_what_was_declared():
    """Recordings write them as they are."""
    params = TagParams()
    assert params.camera.focal == 0
    assert vars(params).keys() == {field.name for field in fields(TagParams)}

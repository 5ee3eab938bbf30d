"""The node that finds things by a network."""

import sys
from pathlib import Path

import numpy as np
import pytest

from ros_visualise.core.errors import OpenError, ParameterError, UnsupportedImage
from ros_visualise.core.params import update
from ros_visualise.data import ENCODINGS, CameraInfo, Header, Image
from ros_visualise.nodes import find
from ros_visualise.nodes import landmark_detector as module
from ros_visualise.vision.projection import project

pytest.importorskip("onnxruntime", reason="pip install 'ros_visualise[detect]' to run this")
sys.path.insert(0, str(Path(__file__).parents[1] / "landmarks" / "networks"))

import made_networks as made

HEADER = Header(123, "camera_optical")
NAMES = str({number: f"thing{number}" for number in range(made.CLASSES)})
K = np.array([[100.0, 0, 63.5], [0, 110, 47.5], [0, 0, 1]])


@pytest.fixture
def model(tmp_path):
    return made.yolo_8(tmp_path / "n.onnx", 128, 96, names=NAMES)


def info(**changes):
    values = {"width": 128, "height": 96, "K": K, "D": np.zeros(5), "distortion_model": "plumb_bob"}
    return CameraInfo(header=HEADER, **{**values, **changes})


def spot(column=71, row=30, encoding="mono8", **more):
    dtype, channels = ENCODINGS[encoding]
    gray = np.full((96, 128), 40, np.uint8)
    gray[row, column] = 255
    pixels = gray.astype(dtype) * np.array(np.iinfo(dtype).max // 255, dtype)
    return Image(
        np.dstack([pixels] * channels) if channels > 1 else pixels, encoding, HEADER, **more
    )


def make(path, **changes):
    params = update(module.LandmarkParams(), {"model": path, **changes})
    return find("landmark_detector").make(params), params


def run(path, image, **changes):
    node, params = make(path, **changes)
    return node.step(image=image, params=params)


def test_a_thing_with_its_name_number_score_and_box(model):
    found = run(model, spot())["detections"]
    (one,) = found.detections
    assert found.header == HEADER
    assert one.center_uv == pytest.approx([71, 30], abs=1e-3)
    assert one.size_uv == pytest.approx(made.SIZE, abs=1e-3)
    assert (one.class_id, one.score) == ("thing2", pytest.approx(made.SCORE))
    assert [what.number for what in one.hypotheses] == [made.CLASS]
    assert one.point_uv is None
    assert not one.hypotheses[0].covariance.any()
    assert found.camera_info is None


@pytest.mark.parametrize("encoding", [name for name in ENCODINGS if "bayer" not in name])
def test_every_encoding(encoding, model):
    (one,) = run(model, spot(encoding=encoding))["detections"].detections
    assert one.center_uv == pytest.approx([71, 30], abs=1e-3)


@pytest.mark.parametrize("encoding", [name for name in ENCODINGS if "bayer" in name])
def test_mosaics_are_made_colours(encoding, model):
    image = spot(encoding=encoding)
    pixels = image.pixels.copy()
    pixels[28:33, 69:74] = pixels.max()
    (one,) = run(model, Image(pixels, encoding, HEADER))["detections"].detections
    assert one.center_uv == pytest.approx([71, 30], abs=2.01)


def test_depth_is_refused(model):
    with pytest.raises(UnsupportedImage, match="not gray or colour values"):
        run(model, Image(np.ones((96, 128), np.float32), "32FC1", HEADER))


@pytest.mark.parametrize("place", ["bottom", "center"])
@pytest.mark.parametrize("D", [[0.0] * 5, [-0.2, 0.05, 0.001, -0.001, 0]])
def test_a_box_has_the_direction_of_where_it_stands(place, D, model):
    camera = info(D=np.array(D))
    found = run(model, spot(camera_info=camera), stands_on=place, box_sigma=0.2)["detections"]
    (one,) = found.detections
    assert found.camera_info is camera
    (what,) = one.hypotheses
    assert np.linalg.norm(what.position_xyz) == pytest.approx(1)
    below = made.SIZE[1] / 2 if place == "bottom" else 0
    pixels, _ = project(what.position_xyz[None], camera)
    assert pixels[0] == pytest.approx([71, 30 + below], abs=1e-3)
    lateral = sideways(what, camera)
    assert np.sqrt(np.diag(lateral)) == pytest.approx(0.2 * np.array(made.SIZE), rel=0.02)
    ray = what.position_xyz
    assert ray @ what.covariance[:3, :3] @ ray == pytest.approx(1e6)
    assert np.linalg.eigvalsh(what.covariance[3:, 3:]).min() == pytest.approx(1e6)


def sideways(what, camera):
    """Covariance of the pixel (2, 2) by the covariance of the position, without what is along."""
    along = np.outer(what.position_xyz, what.position_xyz)
    covariance = what.covariance[:3, :3] - 1e6 * along
    step = 1e-6
    near = what.position_xyz + step * np.eye(3)
    far = what.position_xyz - step * np.eye(3)
    J = (project(near, camera)[0] - project(far, camera)[0]).T / (2 * step)
    return J @ covariance @ J.T


def own_network(path):
    return made.own(path, 128, 96, names="{2: 'post'}")


def test_a_network_of_our_own_tells_points_with_their_uncertainty(tmp_path):
    path = own_network(tmp_path / "n.onnx")
    camera = info()
    (one,) = run(path, spot(camera_info=camera))["detections"].detections
    assert one.class_id == "post"
    assert one.point_uv == pytest.approx([74, 37], abs=1e-3)
    assert one.point_covariance == pytest.approx(np.diag([4.0, 9.0]))
    (what,) = one.hypotheses
    assert project(what.position_xyz[None], camera)[0][0] == pytest.approx([74, 37], abs=1e-3)
    assert sideways(what, camera) == pytest.approx(np.diag([4.0, 9.0]), rel=1e-3, abs=1e-3)


def test_in_a_larger_image_the_uncertainty_is_larger(tmp_path):
    pixels = np.full((288, 384), 40, np.uint8)
    pixels[90:93, 210:213] = 255
    path = own_network(tmp_path / "n.onnx")
    (one,) = run(path, Image(pixels, "mono8", HEADER))["detections"].detections
    assert one.center_uv == pytest.approx([211, 91], abs=1e-3)
    assert one.point_uv == pytest.approx([220, 112], abs=1e-3)
    assert one.point_covariance == pytest.approx(np.diag([36.0, 81.0]), rel=1e-5)


def test_a_calibration_for_another_size_gives_no_directions_and_is_said_once(model, caplog):
    node, params = make(model)
    image = spot(camera_info=info(width=64))
    for _ in range(3):
        (one,) = node.step(image=image, params=params)["detections"].detections
        assert not one.hypotheses[0].covariance.any()
    said = (
        "landmark_detector: detections have no directions:"
        " images are 128x96, their calibration is for 64x96"
    )
    assert [record.message for record in caplog.records] == [
        f"{said} (further occurrences suppressed)"
    ]


@pytest.mark.parametrize(
    "changes", [{"K": np.zeros((3, 3))}, {"distortion_model": "strange"}, {"D": np.zeros(3)}]
)
def test_a_calibration_that_is_none_gives_no_directions(changes, model, caplog):
    (one,) = run(model, spot(camera_info=info(**changes)))["detections"].detections
    assert not one.hypotheses[0].covariance.any()
    assert "landmark_detector: detections have no directions: " in caplog.text


def test_names_are_told_once_and_when_they_change(model, tmp_path):
    node, params = make(model)
    about = node.step(image=spot(), params=params)["vision_info"]
    assert (about.method, about.database_version) == ("YOLOv8/11/12 n.onnx", 1)
    assert (about.database_location, about.header) == (model, HEADER)
    assert node.step(image=spot(), params=params)["vision_info"] is None
    params = update(params, {"min_score": 0.1})
    assert node.step(image=spot(), params=params)["vision_info"] is None
    names = tmp_path / "names.txt"
    names.write_text("a\nb\nc\n")
    params = update(params, {"names": str(names)})
    outputs = node.step(image=spot(), params=params)
    assert outputs["vision_info"].database_version == 2
    assert outputs["vision_info"].database_location == str(names)
    assert outputs["detections"].detections[0].class_id == "c"
    assert (
        run(model, spot(), database_location="/names")["vision_info"].database_location == "/names"
    )


def test_a_class_without_a_name_is_called_by_its_number(tmp_path):
    path = made.yolo_8(tmp_path / "n.onnx", 128, 96)
    names = tmp_path / "names.txt"
    names.write_text("only\n")
    (one,) = run(path, spot(), names=str(names))["detections"].detections
    assert (one.class_id, one.hypotheses[0].number) == ("2", 2)


@pytest.mark.parametrize(
    ("changes", "count"),
    [
        ({"classes": "thing2"}, 1),
        ({"classes": "2, thing0"}, 1),
        ({"classes": "thing1"}, 0),
        ({"min_score": 0.74}, 1),
        ({"min_score": 0.76}, 0),
    ],
)
def test_what_counts_as_found_is_a_parameter(changes, count, model):
    node, params = make(model)
    node.step(image=spot(), params=params)
    changed = update(params, changes)
    assert len(node.step(image=spot(), params=changed)["detections"].detections) == count
    assert len(run(model, spot(), **changes)["detections"].detections) == count


def test_a_large_image_is_searched_in_tiles_when_asked_and_at_once(model, monkeypatch):
    sizes = []
    detect = module.Network.detect

    def watched(self, pixels, order, choice):
        sizes.append(pixels.shape[:2])
        return detect(self, pixels, order, choice)

    monkeypatch.setattr(module.Network, "detect", watched)
    node, params = make(model)
    node.step(image=spot(), params=params)
    assert sizes == [(96, 128)]
    node.step(image=spot(), params=update(params, {"tile": 64}))
    assert sizes[1:] == [(96, 128)] + [(64, 64)] * 6


def test_a_refused_change_leaves_what_was(model, tmp_path):
    node, params = make(model)
    for changes, error in [
        ({"model": str(tmp_path / "none.onnx")}, OpenError),
        ({"classes": "unicorn"}, ParameterError),
    ]:
        params_after = update(params, changes)
        with pytest.raises(error):
            node.step(image=spot(), params=params_after)
        assert len(node.step(image=spot(), params=params_after)["detections"].detections) == 1


def test_another_network_may_be_taken_while_it_runs(model, tmp_path):
    node, params = make(model)
    node.step(image=spot(), params=params)
    other = update(params, {"model": own_network(tmp_path / "other.onnx")})
    outputs = node.step(image=spot(), params=other)
    assert outputs["detections"].detections[0].class_id == "post"
    assert outputs["vision_info"].method == "ros_visualise other.onnx"


def test_the_debug_image_is_drawn_for_who_looks(model, monkeypatch):
    asked = []
    drawn = module.draw_detections
    monkeypatch.setattr(module, "draw_detections", lambda *a: asked.append(1) or drawn(*a))
    image = spot(encoding="rgb16")
    shown = run(model, image)["debug_image"]
    assert (shown.encoding, shown.header, shown.height, shown.width) == ("bgr8", HEADER, 96, 128)
    assert not asked
    assert (shown.pixels != 40).any(axis=2).sum() > 60
    assert asked == [1]
    assert (image.pixels[0, 0] == 40 * 257).all()


def test_the_point_is_drawn_in_red(tmp_path):
    drawn = run(own_network(tmp_path / "n.onnx"), spot(40, 30))["debug_image"].pixels
    column, row = (np.array([40, 30]) + made.POINT).astype(int)
    assert drawn[row, column].tolist() == [0, 0, 255]


def test_without_a_network_it_is_asked_for(monkeypatch, tmp_path):
    monkeypatch.setattr(module, "OWN_MODEL", tmp_path / "none.onnx")
    with pytest.raises(
        OpenError, match=r"landmark_detector: give an ONNX file with model=FILE\.onnx"
    ):
        make("")
    monkeypatch.setattr(module, "OWN_MODEL", Path(own_network(tmp_path / "own.onnx")))
    assert run("", spot())["detections"].detections[0].class_id == "post"

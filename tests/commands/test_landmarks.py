"""`ros-visualise landmarks`: what is in pictures and recordings, and where it is."""

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from ros_visualise.commands import main
from ros_visualise.core.yaml_files import load_yaml
from ros_visualise.landmarks.tags import draw_cells, family
from ros_visualise.simulation.model import build_world

CALIBRATION = """\
image_width: {0}
image_height: {1}
distortion_model: plumb_bob
camera_matrix: {{rows: 3, cols: 3, data: [{2}, 0, {3}, 0, {2}, {4}, 0, 0, 1]}}
distortion_coefficients: {{rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}}
rectification_matrix: {{rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}}
projection_matrix: {{rows: 3, cols: 4, data: [{2}, 0, {3}, 0, 0, {2}, {4}, 0, 0, 0, 1, 0]}}
"""
CELL_PX, LEFT, TOP = 12, 60, 40
DETECTION = {"name", "id", "score", "box", "corners", "point", "frame_id", "pose", "other_pose"}

STOPPED = """
import os, signal, sys
from ros_visualise.__main__ import main
from ros_visualise.commands.landmarks import work

class Runtime(work.LocalRuntime):
    def wait(self, timeout_s):
        ended = super().wait(timeout_s)
        if self.report().nodes["landmark_localizer"].processed >= {images}:
            os.kill(os.getpid(), signal.SIGINT)
        return ended

work.LocalRuntime = Runtime
sys.argv[1:] = {arguments!r}
sys.exit(main())
"""


@pytest.fixture
def find(monkeypatch, capsys):
    """Run the command; its exit status, what it printed, as JSON if asked for, and its errors."""
    monkeypatch.setattr("signal.signal", lambda *_: None)

    def find(*arguments):
        status = main(["landmarks", *map(str, arguments)])
        said = capsys.readouterr()
        is_json = "--json" in arguments and said.out
        return status, json.loads(said.out) if is_json else said.out, said.err

    return find


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    """Tag 7 seen from the front; its square begins at (LEFT, TOP) and has 8 cells a side."""
    cells, rim = draw_cells(family("tag36h11"), 7)
    tag = np.kron(np.where(cells, 220, 30).astype(np.uint8), np.ones((CELL_PX, CELL_PX), np.uint8))
    image = np.full((200, 240), 220, np.uint8)
    left, top = LEFT - rim * CELL_PX, TOP - rim * CELL_PX
    image[top : top + len(tag), left : left + len(tag)] = tag
    path = tmp_path / "picture.png"
    cv2.imwrite(str(path), cv2.GaussianBlur(image, (0, 0), 0.7))
    return path


@pytest.fixture
def ost(tmp_path: Path) -> Path:
    """The calibration of that picture: 400 pixels of focal length, its axis at (120, 100)."""
    path = tmp_path / "ost.yaml"
    path.write_text(CALIBRATION.format(240, 200, 400, 120, 100))
    return path


def test_a_tag_seen_from_the_front_is_where_it_was_drawn(find, picture, ost):
    status, found, _ = find(picture, "--size", 0.24, "--calibration", ost, "--json")
    assert status == 0
    assert set(found) == {"images", "landmarks"}
    [image] = found["images"]
    assert (image["path"], image["stamp"]) == (str(picture), 0)
    assert (image["width"], image["height"]) == (240, 200)
    [tag] = image["detections"]
    assert set(tag) == DETECTION
    assert (tag["name"], tag["id"], tag["frame_id"]) == ("tag36h11_7", 7, "camera_optical")
    side = 8 * CELL_PX
    left, top = LEFT - 0.5, TOP - 0.5  # pixels count from the centre of the first
    corners = [[0, side], [side, side], [side, 0], [0, 0]]
    np.testing.assert_allclose(tag["corners"], np.add(corners, [left, top]), atol=0.1)
    np.testing.assert_allclose(tag["box"], [left, top, side, side], atol=0.2)
    np.testing.assert_allclose(tag["point"], [left + side / 2, top + side / 2], atol=0.1)
    z = 400 * 0.24 / side
    at = [(left + side / 2 - 120) * z / 400, (top + side / 2 - 100) * z / 400, z]
    pose = tag["pose"]
    np.testing.assert_allclose(pose["position"], at, atol=0.005)
    covariance = np.reshape(pose["covariance"], (6, 6))
    np.testing.assert_allclose(covariance, covariance.T)
    assert np.linalg.eigvalsh(covariance)[0] > 0
    off = np.subtract(pose["position"], at)
    assert off @ np.linalg.solve(covariance[:3, :3], off) < 16
    assert tag["other_pose"] is None or set(tag["other_pose"]) == set(pose)
    assert found["landmarks"] == [
        {"name": "tag36h11_7", "frame_id": "camera_optical", "pose": None, "seen": 1}
    ]


def test_without_a_calibration_there_are_corners_alone_and_that_is_said_once(find, picture, caplog):
    (picture.parent / "second.png").write_bytes(picture.read_bytes())
    status, found, _ = find(picture.parent, "--size", 0.24, "--model", "none", "--json")
    assert status == 0
    assert [image["path"][-11:] for image in found["images"]] == ["picture.png", "/second.png"]
    tags = [tag for image in found["images"] for tag in image["detections"]]
    assert [tag["pose"] for tag in tags] == [None, None]
    assert all(len(tag["corners"]) == 4 for tag in tags)
    assert caplog.text.count("have no calibration") == 1
    assert found["landmarks"][0]["seen"] == 2


def test_the_sizes_of_tags_come_from_a_file(find, picture, ost, tmp_path):
    sizes = tmp_path / "tags.yaml"
    sizes.write_text("standalone_tags:\n  - {id: 7, size: 0.48, name: dock}\n")
    status, found, _ = find(picture, "--tags", sizes, "--calibration", ost, "--json")
    tag = found["images"][0]["detections"][0]
    assert (status, tag["name"], tag["id"]) == (0, "dock", 7)
    assert tag["pose"]["position"][2] == pytest.approx(2.0, abs=0.02)


def test_all_is_told_at_a_glance(find, picture, ost):
    status, said, _ = find(picture, "--size", 0.24, "--calibration", ost)
    assert status == 0
    head, tag, total = said.splitlines()
    assert head.split() == ["landmark", "position,", "metres", "+-", "frame"]
    assert tag.split()[0] == "tag36h11_7"
    assert tag.split()[3] == "1.000"
    assert total == "1 landmark in 1 image"
    assert find(picture, "--families", "16h5")[1] == "no landmarks in 1 image\n"


def test_of_a_film_only_the_poses_in_the_camera_are_known_and_that_is_said(find, picture, ost):
    film = picture.with_name("film.avi")
    image = cv2.imread(str(picture))
    writer = cv2.VideoWriter(str(film), cv2.VideoWriter.fourcc(*"MJPG"), 10, image.shape[1::-1])
    for _ in range(3):
        writer.write(image)
    writer.release()
    options = ["--size", 0.24, "--calibration", ost, "--model", "none"]
    status, said, errors = find(film, *options)
    assert status == 0
    assert said.splitlines()[1].split() == ["tag36h11_7", "3", "-", "-", "camera_optical"]
    assert f"{film}: no positions in a fixed frame, because the pose of the camera" in errors
    assert find(film, *options, "--map", film.with_name("map.yaml"))[2].count("fixed frame") == 0
    _, found, _ = find(film, *options, "--json")
    assert found["images"][2]["detections"][0]["pose"]["position"][2] == pytest.approx(1, abs=0.01)


def test_of_several_pictures_each_has_its_poses(find, picture, ost):
    (picture.parent / "second.png").write_bytes(picture.read_bytes())
    status, said, _ = find(picture.parent, "--size", 0.24, "--calibration", ost)
    head, first, second, total = said.splitlines()
    assert status == 0
    assert head.split()[:2] == ["picture", "landmark"]
    for line, name in ((first, "picture.png"), (second, "second.png")):
        assert line.split()[:2] == [name, "tag36h11_7"]
        assert line.split()[4] == "1.000"
    assert total == "1 landmark in 2 images"


def test_a_photo_has_the_tags_that_are_in_it(find, recordings):
    photos = recordings / "tags" / "swatbotics"
    status, found, _ = find(photos / "IMG_1368.JPG", "--json")
    assert status == 0
    assert {tag["id"] for tag in found["images"][0]["detections"]} == {13, 19}


def test_what_cannot_be_read_of_a_folder_is_said_and_lost(find, picture):
    (picture.parent / "broken.png").write_bytes(picture.read_bytes()[:300])
    status, found, errors = find(picture.parent, "--json")
    assert (status, len(found["images"])) == (1, 1)
    assert "broken.png: not a readable image" in errors


def test_tags_that_were_recorded_get_poses(find, recordings, tmp_path):
    bag = recordings / "tagslam" / "example_13" / "tag_detections.bag"
    ost = tmp_path / "ost.yaml"
    ost.write_text(CALIBRATION.format(2048, 2048, 1501.5, 1025.7, 1030.5))
    status, found, _ = find(bag, "--size", 0.12, "--calibration", ost, "--frames", 3, "--json")
    assert status == 0
    assert [image["path"] for image in found["images"]] == [None] * 3
    image = found["images"][0]
    assert (image["width"], image["height"]) == (2048, 2048)
    assert image["stamp"] == pytest.approx(1527206460.0425704)
    tags = {tag["name"]: np.array(tag["pose"]["position"]) for tag in image["detections"]}
    assert len(tags) > 5
    beside = np.linalg.norm(tags["tag36h11_72"] - tags["tag36h11_76"])  # one to the right and up
    assert beside == pytest.approx(0.15 * np.sqrt(2), abs=0.02)


def test_recorded_tags_without_a_calibration_have_no_poses_and_that_is_said_once(
    find, recordings, caplog
):
    bag = recordings / "tagslam/example_13/tag_detections.bag"
    status, found, _ = find(bag, "--size", 0.15, "--frames", 3, "--json")
    assert status == 0
    detections = [one for image in found["images"] for one in image["detections"]]
    assert len(detections) > 3
    assert all(len(one["corners"]) == 4 and one["pose"] is None for one in detections)
    assert caplog.text.count("the tags come without a camera calibration") == 1


@pytest.mark.usefixtures("opengl")
@pytest.mark.parametrize("images", [1, 30])
def test_a_run_that_is_stopped_keeps_its_map_or_says_that_there_is_none(tmp_path, images):
    out = tmp_path / "map.yaml"
    arguments = ["landmarks", "husky", "--model", "none", "--map", str(out)]
    code = STOPPED.format(images=images, arguments=arguments)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 130, done.stderr
    if out.exists():
        assert load_yaml(out)["landmarks"]
    else:
        assert f"{out}: not written: no landmarks in the map yet" in done.stderr


@pytest.mark.usefixtures("opengl")
def test_the_landmarks_of_a_simulated_world_are_mapped(find, tmp_path):
    out = tmp_path / "map.yaml"
    status, found, _ = find("husky", "--duration", 2, "--map", out, "--json")
    assert status == 0
    truth = build_world("field", pictures=False).landmark("tag_0")
    [tag] = [one for one in found["landmarks"] if one["name"] == "tag36h11_0"]
    assert tag["frame_id"] == "map"
    views = sum(
        any(one["name"] == "tag36h11_0" for one in image["detections"]) for image in found["images"]
    )
    assert views - 2 <= tag["seen"] <= views, "but for those that do not fit"
    off = np.subtract(tag["pose"]["position"], truth.position_xyz)
    covariance = np.reshape(tag["pose"]["covariance"], (6, 6))[:3, :3]
    assert off @ np.linalg.solve(covariance, off) < 25
    [told] = [one for one in found["smoothing"]["landmarks"] if one["name"] == "tag36h11_0"]
    assert told["sightings"] == tag["seen"]
    assert told["size_m"] == 0.48
    mapped = load_yaml(out)["landmarks"]
    assert mapped[0]["pose"]["position"] == pytest.approx(tag["pose"]["position"], abs=1e-6)
    assert find("husky", "--duration", 1, "--map", out)[0] == 2  # it is there


@pytest.mark.usefixtures("opengl")
def test_a_recording_with_its_own_landmarks_is_mapped_anew(find, tmp_path):
    run = tmp_path / "run.mcap"
    options = [
        "--mission",
        "default",
        "--duration",
        "2",
        "--view",
        "none",
        "--rate",
        "0",
        "--record",
        str(run),
    ]
    assert main(["sim", "husky", *options]) == 0
    status, found, _ = find(run, "--size", 0.48, "--json")
    assert status == 0
    assert {one["name"]: one["frame_id"] for one in found["landmarks"]}["tag36h11_0"] == "map"
    assert found["images"][0]["width"] == 640
    status, again, _ = find(run, "--topic", "/detections", "--json")  # their poses are recorded
    assert status == 0
    places = [
        next(tag["pose"]["position"] for tag in one["landmarks"] if tag["name"] == "tag36h11_0")
        for one in (found, again)
    ]
    np.testing.assert_allclose(*places, atol=0.02)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nothing.jpg"], "nothing.jpg: no such file"),
        (["{photo}", "--tags", "none.yaml"], "none.yaml: no such file"),
        (["{photo}", "--calibration", "none.yaml"], "none.yaml: no such file"),
        (["{photo}", "--calibration", "{bad}"], "bad.yaml: no camera calibration"),
        (["{photo}", "--tags", "{bad}"], "bad.yaml"),
        (["{photo}", "--families", "tag99"], "no such tag family: 'tag99'; choose from tag36h11"),
        (
            ["{photo}", "--map", "{folder}/map.yaml", "--survey", "none.yaml"],
            "none.yaml: no such file",
        ),
        (["{photo}", "--map", "{folder}/map.txt"], "map.txt: give a map a name that ends in .yaml"),
        (["{photo}", "--survey", "none.yaml"], "requires --map OUT.yaml"),
        (["{photo}", "--topic", "/image"], "--topic /image: only valid with a recording"),
        (["{bad}"], "bad.yaml: not a video that FFmpeg can read"),
        (["{folder}"], "no recording, video or picture in this folder"),
        ([""], "give a picture, a folder of pictures, a video, a recording"),
        (["{photo}", "--world", "field"], "--world: only valid with a simulated robot"),
        (["{photo}", "--seed", "1"], "--seed: only valid with a simulated robot"),
        (["{photo}", "--mission", "square"], "--mission: only valid with a simulated robot"),
        (["husky", "--calibration", "{ost}"], "a simulated camera knows its own"),
    ],
)
def test_bad_input_is_one_line(find, picture, ost, tmp_path, arguments, message):
    bad, folder = tmp_path / "bad.yaml", tmp_path / "folder"
    bad.write_text("- 1\n")
    folder.mkdir()
    there = {"photo": picture, "bad": bad, "folder": folder, "ost": ost}
    status, said, errors = find(*(text.format(**there) for text in arguments))
    assert (status, said) == (2, "")
    assert message in errors
    assert errors.count("\n") == 1

"""Sequences of EuRoC and TUM-VI: cameras, IMU, ground truth, and their damage."""

from contextlib import closing

import cv2
import numpy as np
import pytest

from ros_visualise.geometry import se3
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.sources.opening import is_recording, open_recording

STAMPS = (1403636579758555392, 1403636579808555392)  # no float holds them
T_BS = [[0.0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]]
INTRINSICS = "camera_model: pinhole\nintrinsics: [45.5, 46.5, 4, 3]\nresolution: [8, 6]\n"
EUROC = f"""sensor_type: camera
T_BS:
  cols: 4
  rows: 4
  data: {np.ravel(T_BS).tolist()}
{INTRINSICS}distortion_model: radial-tangential
distortion_coefficients: [-0.28, 0.07, 0.0002, 0.00002]
"""
TUM_VI = f"""cam0:
  T_cam_imu: {se3.inverse(np.array(T_BS)).tolist()}
  {INTRINSICS.strip().replace(chr(10), chr(10) + "  ")}
  distortion_model: equidistant
  distortion_coeffs: [0.003, 0.0007, -0.002, 0.0002]
"""


def table(folder, *lines):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "data.csv").write_text("\r\n".join(["#timestamp [ns],...", *lines, ""]))


@pytest.fixture
def sequence(tmp_path):
    """MH_01 of two images, two measurements and two poses."""
    body = tmp_path / "MH_01_easy" / "mav0"
    table(body / "cam0", *(f"{one},{one}.png" for one in STAMPS))
    (body / "cam0" / "data").mkdir()
    for value, stamp in enumerate(STAMPS, 1):
        pixels = np.full((6, 8), 256 * value, np.uint16)
        cv2.imwrite(str(body / "cam0" / "data" / f"{stamp}.png"), pixels)
    (body / "cam0" / "sensor.yaml").write_text(EUROC)
    table(body / "imu0", *(f"{one},0.1,0.2,0.3,1,2,9.8" for one in STAMPS))
    table(
        body / "state_groundtruth_estimate0",
        *(f"{one},1,2,3,0.5,0.5,-0.5,0.5,0,0,0,0,0,0,0,0,0" for one in STAMPS),
    )
    return body.parent


def content(folder):
    with closing(open_recording(folder)) as recording, closing(recording.read()) as entries:
        found = {}
        for entry in entries:
            found.setdefault(entry.topic, []).append(entry.message)
        return found, recording


def frames_of(found):
    tree = FrameTree()
    tree.add(found["/tf_static"][0], True)
    return tree


@pytest.mark.parametrize("below", ["", "mav0"])
def test_a_sequence_is_played_with_its_calibration_and_truth(sequence, below):
    assert is_recording(sequence / below)
    found, recording = content(sequence / below)
    assert (recording.format, recording.notes, bool(recording.loss)) == ("EuRoC", [], False)
    images, infos = found["/cam00/image_raw"], found["/cam00/camera_info"]
    assert tuple(one.header.stamp_ns for one in images) == STAMPS
    assert [int(one.pixels.max()) for one in images] == [1, 2]  # TUM-VI has 16 bits
    assert images[0].encoding == "mono8"
    assert (infos[0].width, infos[0].height, infos[0].distortion_model) == (8, 6, "plumb_bob")
    assert infos[0].K[[0, 1, 0, 1], [0, 1, 2, 2]].tolist() == [45.5, 46.5, 4, 3]
    imu, pose = found["/imu/data"][1], found["/ground_truth/odom"][0]
    assert [*imu.angular_xyz, *imu.linear_xyz] == [0.1, 0.2, 0.3, 1, 2, 9.8]
    assert pose.quat_xyzw.tolist() == [0.5, -0.5, 0.5, 0.5]  # w comes first in the file
    assert pose.position_xyz.tolist() == [1, 2, 3]
    tree = frames_of(found)
    np.testing.assert_allclose(tree.lookup("base_link", "cam00_optical", 0), T_BS)
    np.testing.assert_allclose(tree.lookup("base_link", "imu_link", 0), np.eye(4))


def test_tum_vi_has_a_fisheye_and_motion_capture(sequence):
    body = sequence / "mav0"
    (sequence / "dso").mkdir()
    (sequence / "dso" / "camchain.yaml").write_text(TUM_VI)  # goes before sensor.yaml
    (body / "state_groundtruth_estimate0").rename(body / "mocap0")
    found, _ = content(sequence)
    info = found["/cam00/camera_info"][0]
    assert (info.distortion_model, info.D.tolist()) == (
        "equidistant",
        [0.003, 0.0007, -0.002, 0.0002],
    )
    assert len(found["/ground_truth/odom"]) == 2
    np.testing.assert_allclose(frames_of(found).lookup("base_link", "cam00_optical", 0), T_BS)


def test_damage_is_reported_and_the_rest_is_played(sequence):
    body = sequence / "mav0"
    (body / "cam0" / "data" / f"{STAMPS[0]}.png").unlink()
    (body / "cam0" / "sensor.yaml").write_text(EUROC.replace("pinhole", "omni"))
    with (body / "imu0" / "data.csv").open("a") as file:
        file.write("1403636579908555392,0.1,nan,0.3,1,2,9.8\nnonsense\n")
    found, recording = content(sequence)
    assert len(found["/cam00/image_raw"]) == 1
    assert found["/cam00/image_raw"][0].camera_info is None
    assert len(found["/imu/data"]) == 2
    assert "camera model omni" in recording.notes[0]
    lost = "\n".join(recording.loss.notes)
    assert "cam0: 1 of 2 frames are missing" in lost
    assert "mav0/imu0/data.csv: 2 of 4 lines are damaged" in lost


def test_a_part_of_a_sequence_names_the_whole(sequence):
    with pytest.raises(Exception, match="a part of a EuRoC folder; give the whole"):
        open_recording(sequence / "mav0" / "imu0")

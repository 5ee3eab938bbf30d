"""Calibrations are kept where camera_info_url says, in the format of ROS, whole or not at all."""

import os
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ros_visualise.core.errors import OpenError, RecordingError, UsageError
from ros_visualise.data import CameraInfo
from ros_visualise.sources.calibration import (
    check,
    locate,
    read_calibration,
    read_uncertainty,
    save,
    to_yaml,
)

CONVERT = Path("/usr/lib/camera_calibration_parsers/convert")
TURN = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
INFO = CameraInfo(
    height=480,
    width=640,
    K=np.array([[535.92, 0, 342.28], [0, 535.5, 235.57], [0, 0, 1]]),
    D=np.array([-0.26637, 1e-05, 1 / 3, -2.8e-17, 0.238392]),
    R=TURN,
    P=np.array([[500, 0, 340, -25.5], [0, 501, 236, 0], [0, 0, 1, 0]]),
)
FISHEYE = replace(INFO, D=np.array([0.1, 0.2, 0.3, 0.4]), distortion_model="equidistant")


@pytest.mark.parametrize(
    ("url", "expected"),
    [
        ("", "file:///home/me/.ros/camera_info/uav1_front.yaml"),
        ("file://${ROS_HOME}/${NAME}_5mm.yaml", "file:///home/me/.ros/uav1_front_5mm.yaml"),
        ("package://mine/${NAME}.yaml", "package://mine/uav1_front.yaml"),
        ("/data/ost.yaml", "/data/ost.yaml"),
    ],
)
def test_an_address_is_that_of_camera_info_manager(url, expected, monkeypatch):
    monkeypatch.setenv("ROS_HOME", "/home/me/.ros")
    assert locate(url, "/uav1/front/") == expected
    monkeypatch.delenv("ROS_HOME")
    monkeypatch.setenv("HOME", "/home/me")
    assert locate(url, "/uav1/front") == expected


@pytest.mark.parametrize("info", [INFO, FISHEYE, replace(INFO, P=None)])
def test_what_is_written_is_what_is_read(info, tmp_path):
    path = tmp_path / "new" / "folder" / "front.yaml"
    save(info, path, "front")
    found = read_calibration(str(path))
    assert (found.width, found.height) == (640, 480)
    assert found.distortion_model == info.distortion_model
    for name in "KDR":
        np.testing.assert_array_equal(getattr(found, name), getattr(info, name))
    P = np.column_stack([info.K, np.zeros(3)]) if info.P is None else info.P
    np.testing.assert_array_equal(found.P, P)


def test_the_uncertainty_is_read_as_it_was_written(tmp_path):
    root = np.random.default_rng(0).normal(size=(9, 9)) * [2, 3, 1, 4, *[0.01] * 5]
    path, covariance = tmp_path / "front.yaml", root.T @ root
    path.write_text(to_yaml(INFO, "front", covariance))
    found = read_uncertainty(f"file://{path}")
    np.testing.assert_array_equal(found.covariance, covariance)
    fx, fy, cx, cy = np.sqrt(np.diag(covariance))[:4]
    assert found.focal == pytest.approx(max(fx / 535.92, fy / 535.5))
    assert found.center_px == pytest.approx(max(cx, cy))
    assert read_calibration(str(path)).K.tolist() == INFO.K.tolist()


@pytest.mark.parametrize(
    ("covariance", "why"),
    [
        (None, "no intrinsics_covariance; create the file with ros-visualise calibrate"),
        (np.eye(4), "its intrinsics_covariance has 16 numbers, not 81"),
        (-np.eye(9), "its intrinsics_covariance is not symmetric and positive semidefinite"),
        (np.triu(np.ones((9, 9))), "is not symmetric"),
        (np.full((9, 9), np.nan), "holds a value that is not a number"),
    ],
)
def test_a_file_without_a_valid_uncertainty_is_refused(covariance, why, tmp_path):
    path = tmp_path / "front.yaml"
    path.write_text(to_yaml(INFO, "front", covariance))
    with pytest.raises(OpenError, match=why):
        read_uncertainty(str(path))
    assert read_calibration(str(path)).width == 640


@pytest.mark.skipif(not CONVERT.exists(), reason="apt install camera-calibration-parsers-tools")
def test_the_parsers_of_ros_read_it(tmp_path):
    path, ini = tmp_path / "front.yaml", tmp_path / "front.ini"
    path.write_text(to_yaml(INFO, "front", np.eye(9)))
    subprocess.run([CONVERT, path, ini], check=True, capture_output=True)
    text = ini.read_text()
    assert "[front]" in text
    assert "535.92" in text
    assert "-0.26637" in text


def test_a_file_is_replaced_whole_and_a_link_stays(tmp_path):
    path, link = tmp_path / "front.yaml", tmp_path / "link.yaml"
    save(INFO, path, "front")
    link.symlink_to(path)
    with path.open() as old:
        save(FISHEYE, link, "front")
        assert "plumb_bob" in old.read()  # whoever reads it still has the old one, whole
    assert link.is_symlink()
    assert read_calibration(str(path)).distortion_model == "equidistant"
    assert sorted(os.listdir(tmp_path)) == ["front.yaml", "link.yaml"]


def test_where_nothing_can_be_written_it_is_said_and_nothing_left(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(RecordingError, match=r"file/front\.yaml: cannot be written: File exists"):
        save(INFO, tmp_path / "file" / "front.yaml", "front")
    (tmp_path / "front.yaml").mkdir()
    with pytest.raises(RecordingError, match="Is a directory"):
        save(INFO, tmp_path / "front.yaml", "front")
    assert sorted(os.listdir(tmp_path)) == ["file", "front.yaml"]


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"width": 320}, "it is for images of 320x480; the camera's are 640x480"),
        ({"K": np.zeros((3, 3))}, "its K has no focal lengths"),
        ({"R": TURN * np.nan}, "holds a value that is not a number"),
        ({"P": np.full((3, 4), np.inf)}, "holds a value that is not a number"),
        ({"distortion_model": "mine"}, "unsupported distortion_model 'mine'; use one of plumb_bob"),
        ({"D": np.zeros(3)}, "has 3 coefficients of plumb_bob"),
    ],
)
def test_nonsense_is_refused(changes, expected):
    check(INFO, (640, 480))
    with pytest.raises(UsageError, match=expected):
        check(replace(INFO, **changes), (640, 480))

"""A camera is calibrated while it runs, as ROS's cameracalibrator does it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import rospy
from dynamic_reconfigure.client import Client
from made_videos import numbered, write_video
from ros_graph import end, wait_for
from sensor_msgs.msg import CameraInfo
from sensor_msgs.srv import SetCameraInfo

CALIBRATE = Path(__file__).with_name("calibrate.py")
CALIBRATOR = Path("/usr/lib/camera_calibration/cameracalibrator.py")
FOCAL = 300.0


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_video(tmp_path_factory.mktemp("video") / "v.mkv", numbered(12, 160, 120))


@pytest.fixture
def home(ros_master) -> Any:
    """Where calibrations are kept; empty again after the test.

    Nodes that were launched before leave their parameters behind, and with them another place.
    """
    if rospy.has_param("/streamer"):
        rospy.delete_param("/streamer")
    folder = Path(ros_master.environment["ROS_HOME"]) / "camera_info"
    yield folder
    for file in folder.glob("*"):
        file.unlink()


def calibration(focal: float = 150.0) -> CameraInfo:
    info = CameraInfo(height=120, width=160, distortion_model="plumb_bob", D=[0.1, 0, 0, 0, 0])
    info.K = [focal, 0, 80, 0, focal, 60, 0, 0, 1]
    info.R = np.eye(3).ravel().tolist()
    info.P = [focal, 0, 80, 0, 0, focal, 60, 0, 0, 0, 1, 0]
    return info


def call(service: str, info: CameraInfo) -> Any:
    rospy.wait_for_service(service, 60)
    return rospy.ServiceProxy(service, SetCameraInfo)(info)


def test_it_is_published_at_once_and_after_the_next_start(start, hear, video, home):
    streamer = start("streamer", f"_path:={video}", "_loop:=true")
    infos = hear("camera_info", CameraInfo)
    assert not any(infos.wait()[-1].K)
    assert call("set_camera_info", calibration()).success
    wait_for(lambda: infos.messages[-1].K[0] == 150, "the calibration")
    assert "camera_name: streamer" in (home / "streamer.yaml").read_text()
    end(streamer)
    wait_for(lambda: not infos.subscriber.get_num_connections(), "its end")
    del infos.messages[:]
    start("streamer", f"_path:={video}", "_loop:=true")
    assert infos.wait()[-1].K[0] == 150


def test_it_is_written_where_camera_info_url_says(start, hear, video, tmp_path):
    url = f"file://{tmp_path}/${{NAME}}_8mm.yaml"
    args = ["__name:=front", "image_raw:=front/image_raw"]
    start("streamer", f"_path:={video}", "_loop:=true", f"_camera_info_url:={url}", *args)
    infos = hear("front/camera_info", CameraInfo)
    assert call("front/set_camera_info", calibration(151)).success
    wait_for(lambda: infos.messages and infos.messages[-1].K[0] == 151, "the calibration")
    assert (tmp_path / "front_8mm.yaml").is_file()


def test_nonsense_is_refused_and_nothing_written(start, video, home):
    start("streamer", f"_path:={video}", "_loop:=true")
    wrong = calibration()
    wrong.width = 320
    answer = call("set_camera_info", wrong)
    assert not answer.success
    assert answer.status_message.startswith("it is for images of 320x120; the camera's are 160")
    answer = call("set_camera_info", calibration(float("nan")))
    assert not answer.success
    assert "not a number" in answer.status_message
    assert not list(home.glob("*"))


@pytest.mark.skipif(
    not CALIBRATOR.exists(),
    reason="on Debian: apt install ros-camera-calibration python3-message-filters",
)
def test_cameracalibrator_calibrates_it(ros_master, start, hear, tmp_path, home):
    views = write_video(tmp_path / "board.mkv", [board(n) for n in range(12)])
    start("streamer", f"_path:={views}", "_loop:=true", "_rate:=0.2")
    infos = hear("camera_info", CameraInfo)
    command = ["/usr/bin/python3", str(CALIBRATE), "image:=image_raw", "camera:=/"]
    ros_master.call(*command, timeout_s=120)
    found = wait_for(lambda: any(infos.messages[-1].K) and infos.messages[-1], "the calibration")
    assert found.K[0] == pytest.approx(FOCAL, rel=0.02)
    assert (home / "streamer.yaml").is_file()


def board(number: int) -> np.ndarray:
    """A chessboard of 8x6 squares as a camera without distortion sees it, turned some way."""
    squares = np.kron((np.indices((6, 8)).sum(0) % 2) * 255, np.ones((40, 40))).astype(np.uint8)
    flat = np.pad(squares, 40, constant_values=255)
    turns = [0.5 * np.sin(2.1 * number), 0.5 * np.cos(1.7 * number), 0.3 * np.sin(number)]
    R, _ = cv2.Rodrigues(np.array(turns))
    at = np.array([0.06 * np.cos(1.3 * number), 0.05 * np.sin(2.3 * number), 0.9 + 0.03 * number])
    K = np.array([[FOCAL, 0, 160], [0, FOCAL, 120], [0, 0, 1]])
    to_metres = np.array([[0.05 / 40, 0, -0.25], [0, 0.05 / 40, -0.2], [0, 0, 1]])
    H = K @ np.column_stack([R[:, :2], at]) @ to_metres
    gray = cv2.warpPerspective(flat, H, (320, 240), flags=cv2.INTER_AREA, borderValue=255)
    return cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR)


def test_a_file_that_was_named_while_it_runs_is_not_replaced(start, video, home, tmp_path):
    mine, theirs = tmp_path / "mine.yaml", tmp_path / "theirs.yaml"
    options = [f"_record_dir:={tmp_path}", f"_camera_info_url:={mine}", "_loop:=true"]
    start("streamer", f"_path:={video}", *options)
    for _ in range(2):
        assert call("set_camera_info", calibration()).success
    theirs.write_text(before := mine.read_text())
    Client("streamer", timeout=60).update_configuration({"camera_info_url": theirs.name})
    answer = call("set_camera_info", calibration(151))
    assert not answer.success
    assert "theirs.yaml exists" in answer.status_message
    assert theirs.read_text() == before

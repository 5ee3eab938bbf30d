"""The node that calibrates: it keeps views, tells what to do, and saves what a camera reads."""

import cv2
import numpy as np

from ros_visualise.data import Header, Image
from ros_visualise.nodes.calibrator import CalibratorParams, CameraCalibrator
from ros_visualise.sources.calibration import read_calibration


def test_real_pictures_become_a_calibration(recordings, tmp_path):
    params = CalibratorParams(file=str(tmp_path / "camera.yaml"))
    node = CameraCalibrator(params)
    for number, path in enumerate(sorted((recordings / "calib" / "opencv").glob("left*.jpg"))):
        image = Image(cv2.imread(str(path)), "bgr8", Header(number, "cam"))
        shown = node.step(image, params)
    assert (shown.width, shown.height, shown.header) == (640, 480, image.header)
    assert (shown.pixels != image.pixels).any()
    before = node.save(params)
    assert (before.pixels != shown.pixels).any()  # a notice: nothing to save yet
    node.calibrate()
    node.save(params)
    assert read_calibration(params.file).K[0, 0] == node.report()["K"][0]
    assert abs(node.report()["K"][0] - 532.8) < 1


def test_too_few_views_are_no_error():
    node = CameraCalibrator(CalibratorParams())
    assert node.calibrate() is None
    shown = node.step(Image(np.zeros((48, 64), np.uint8), "mono8"), CalibratorParams())
    assert shown.encoding == "bgr8"
    assert node.report()["next"] == "hold the board in front of the camera"


def test_another_board_begins_anew(recordings):
    node = CameraCalibrator(CalibratorParams())
    path = recordings / "calib" / "opencv" / "left01.jpg"
    image = Image(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), "mono8")
    node.step(image, CalibratorParams())
    assert node.report()["views"] == 1
    node.step(image, CalibratorParams(board="4x11"))
    assert node.report()["views"] == 0

"""Calibrates a camera as `cameracalibrator.py` does, but for its window: its own node, its buttons.

/usr/bin/python3 calibrate.py image:=/image_raw camera:=/
"""

import time

import rospy
from camera_calibration.calibrator import ChessboardInfo
from camera_calibration.camera_calibrator import CalibrationNode

ENOUGH = 6  # views of the board

rospy.init_node("cameracalibrator")
node = CalibrationNode([ChessboardInfo("chessboard", 7, 5, 0.05)], camera_name="mine")
while node.c is None or len(node.c.db) < ENOUGH:
    time.sleep(0.05)
node.c.do_calibration()  # CALIBRATE
assert node.do_upload()  # COMMIT

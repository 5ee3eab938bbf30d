"""Calibration from Python, and a picture without the distortion of the lens.

python examples/15_calibrate.py photos straight.png
"""

import sys
from pathlib import Path

import cv2

import ros_visualise as rv

if len(sys.argv) != 3:
    sys.exit(__doc__)
folder, target = sys.argv[1:]
photos = sorted(Path(folder).iterdir())
camera = rv.calibrate(photos, "9x6")
info = camera.info
print(f"fx {info.K[0, 0]:.1f}, fy {info.K[1, 1]:.1f}, rms {camera.fit.rms:.2f} pixels")
picture = cv2.imread(str(photos[0]))
cv2.imwrite(target, cv2.undistort(picture, info.K, info.D))

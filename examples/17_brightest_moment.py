"""The frames of a film as arrays: when is it brightest, and what does that look like?

python examples/17_brightest_moment.py flight.mp4 brightest.png
"""

import sys

import cv2

import ros_visualise as rv

if len(sys.argv) != 3:
    sys.exit(__doc__)
source, target = sys.argv[1:]
brightest = max(rv.frames(source), key=lambda frame: frame.pixels.mean())
cv2.imwrite(target, brightest.pixels)
print(f"{brightest.stamp_ns / 1e9:.2f} s, {brightest.pixels.mean():.1f} of 255")

"""Nodes as functions: one picture by several edge detectors, side by side.

python examples/16_choose_a_filter.py photo.jpg methods.png
"""

import sys

import cv2

import ros_visualise as rv

if len(sys.argv) != 3:
    sys.exit(__doc__)
source, target = sys.argv[1:]
[frame] = rv.frames(source)
rows = []
for method in ("canny", "sobel", "scharr", "laplacian"):
    detector = rv.node_function("edge_detector", method=method, low=50, high=150)
    edges = detector(frame.pixels).of("edges", rv.Image).pixels.copy()
    cv2.putText(edges, method, (10, 30), cv2.FONT_HERSHEY_SIMPLEX, 1, 255, 2)
    rows.append(edges)
cv2.imwrite(target, cv2.vconcat([cv2.hconcat(rows[:2]), cv2.hconcat(rows[2:])]))

"""Tags in a picture from Python, drawn into it.

python examples/14_detect_tags.py tags.png found.png
"""

import sys

import cv2
import numpy as np

import ros_visualise as rv

if len(sys.argv) != 3:
    sys.exit(__doc__)
source, target = sys.argv[1:]
picture = cv2.imread(source)
for tag in rv.detect(source, "tag36h11"):
    corners = np.round(tag.corners_uv).astype(int)
    cv2.polylines(picture, [corners], True, (0, 200, 0), 2)
    cv2.putText(picture, tag.id, corners[3], cv2.FONT_HERSHEY_SIMPLEX, 0.8, (0, 0, 255), 2)
    print(tag.class_id, tag.corners_uv.round(1).tolist())
cv2.imwrite(target, picture)

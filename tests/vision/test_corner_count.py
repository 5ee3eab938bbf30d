"""A camera that moves back sees its corners crowd in the middle: few too many are kept."""

import cv2
import numpy as np

from ros_visualise.sources.flyover import draw_landscape
from ros_visualise.vision.tracking import CornerTracker


def test_crowded_corners_are_dropped_and_the_oldest_stay():
    picture = cv2.cvtColor(draw_landscape(), cv2.COLOR_BGR2GRAY)
    tracker, oldest = CornerTracker(100), np.zeros(0, np.int64)
    for half in range(100, 260, 10):
        part = picture[600 - half : 600 + half, 800 - half : 800 + half]
        followed = tracker.follow(cv2.resize(part, (320, 320), interpolation=cv2.INTER_AREA))
        oldest = oldest[np.isin(oldest, followed.ids)] if len(oldest) else oldest
        corners = tracker.refill()
        oldest = oldest if len(oldest) else corners.ids[:20]
        assert len(corners.ids) <= 150
        assert (np.diff(corners.ids) > 0).all()
    assert len(corners.ids) > 80
    assert np.isin(oldest, corners.ids).any()
    columns = np.histogram(corners.pixels_uv[:, 0], 4, (0, 320))[0]
    assert columns.min() > 10

"""OpenCV works on small images in one thread, and on large ones in all that it had."""

import numpy as np
import pytest

from ros_visualise.vision import threads

cv2 = pytest.importorskip("cv2")


def test_the_threads_follow_the_size_of_the_images():
    before = cv2.getNumThreads()
    try:
        for shape, expected in {
            (480, 854, 3): 1,
            (2160, 3840): threads._MOST,
            (480, 854): 1,
        }.items():
            threads.fit_threads(np.zeros(shape, np.uint8))
            assert cv2.getNumThreads() == expected
    finally:
        cv2.setNumThreads(before)

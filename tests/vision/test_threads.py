"""OpenCV works on small images in one thread, and on large ones in all that it had."""

import os
import subprocess
import sys

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


def test_numpy_has_no_threads_of_its_own_in_our_processes():
    """They would wait for work at full load beside the nodes' threads."""
    code = "import ros_visualise.__main__, numpy, os; print(len(os.listdir('/proc/self/task')))"
    unset = {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"}
    ran = subprocess.run([sys.executable, "-c", code], env=unset, capture_output=True, check=True)
    assert int(ran.stdout) == 1

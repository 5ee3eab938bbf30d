"""Pictures in which nothing can be followed: frozen, dark, faded or blurred ones."""

from __future__ import annotations

from collections import deque

import cv2
import numpy as np

from ros_visualise.data import Pixels

FROZEN = "the picture is frozen"
_DARK = 6.0  # gray levels, mean
_FLAT = 4.0  # gray levels, standard deviation
_BLURRED = 0.2  # of the usual strength of edges
_USUAL = 30  # images that show what is usual
_FROZEN = 2  # identical images in a row, beyond the first
_SMALL = 160  # pixels, width in which an image is judged


class PictureJudge:
    """Judges the images of a camera, one after the other."""

    def __init__(self) -> None:
        self._before: Pixels | None = None
        self._same = 0
        self._edges: deque[float] = deque(maxlen=_USUAL)

    def fault(self, gray: Pixels) -> str:
        """The reason why an image (H, W), uint8, is useless; empty if it is not."""
        is_same = self._before is not None and np.array_equal(self._before, gray)
        self._same = self._same + 1 if is_same else 0
        self._before = gray
        step = max(gray.shape[1] // _SMALL, 1)
        few = gray[::step, ::step]
        mean, spread = float(few.mean()), float(few.std())
        if mean < _DARK:
            return "too dark"
        if spread < _FLAT:
            return "no texture"
        if self._same >= _FROZEN:
            return FROZEN
        rows = gray[:: max(gray.shape[0] // 60, 1)]
        edges = float(np.abs(cv2.Sobel(rows, cv2.CV_16S, 1, 0, ksize=1)).mean()) / spread
        usual = float(np.median(self._edges)) if self._edges else edges
        if len(self._edges) > 3 and edges < _BLURRED * usual:
            return "blurred"
        self._edges.append(edges)
        return ""

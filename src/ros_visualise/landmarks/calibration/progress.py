"""Progress image of a calibration: the board, the coverage, and what to do next."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ros_visualise.data import Pixels
from ros_visualise.landmarks.calibration.views import BoardView, Coverage
from ros_visualise.vision.reshape import Size

_COVERED = (90, 200, 90)  # blue, green, red
_BOARD = (30, 140, 255)
_WHITE = (255, 255, 255)
_DARK = (40, 40, 40)


def draw_progress(
    gray: Pixels, view: BoardView | None, coverage: Coverage, lines: Sequence[str]
) -> Pixels:
    """The image with the covered parts in green, the detected board, bars and texts.

    Args:
        gray: (height, width) uint8.
        view: the board in it.
        coverage: of the kept views.
        lines: texts below the bars.

    Returns:
        (height, width, 3) uint8, blue, green, red.
    """
    height, width = gray.shape
    share = np.minimum(coverage.cells / max(float(coverage.cells.max()), 1.0), 1) ** 0.5
    tint = cv2.resize(share.astype(np.float32), (width, height), interpolation=cv2.INTER_NEAREST)
    weight = 0.5 * tint[..., None]
    drawn = np.asarray(gray[..., None] * (1 - weight) + np.array(_COVERED) * weight, np.uint8)
    unit = max(height / 480, 0.3)
    if view is not None:
        for u, v in view.points.uv:
            place = round(float(u)), round(float(v))
            cv2.circle(drawn, place, max(2, round(3 * unit)), _BOARD, -1, cv2.LINE_AA)
    _write(drawn, coverage, lines, unit)
    return drawn


def _write(drawn: Pixels, coverage: Coverage, lines: Sequence[str], unit: float) -> None:
    step, gap = round(20 * unit), round(8 * unit)
    height, width = drawn.shape[:2]
    left, length = round(60 * unit), round(100 * unit)
    rows = len(coverage.bars)
    cv2.rectangle(drawn, (0, 0), (left + length + gap, rows * step + gap), _DARK, -1)
    for row, (name, bar) in enumerate(coverage.bars.items(), 1):
        base = row * step
        top = base - round(11 * unit)
        _text(drawn, name, (gap, base), unit)
        cv2.rectangle(drawn, (left, top), (left + length, base), _WHITE, 1)
        cv2.rectangle(drawn, (left, top), (left + round(length * bar), base), _COVERED, -1)
    cv2.rectangle(drawn, (0, height - len(lines) * step - gap), (width, height), _DARK, -1)
    for row, line in enumerate(lines, 1):
        _text(drawn, line, (gap, height - (len(lines) - row) * step - gap), unit)


def _text(drawn: Pixels, text: str, place: Size, unit: float) -> None:
    cv2.putText(drawn, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.45 * unit, _WHITE, 1, cv2.LINE_AA)

"""Detections drawn over their image."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ros_visualise.data import Detection, Floats, Pixels
from ros_visualise.vision.color import to_bgr
from ros_visualise.vision.depth import to_8_bit

_OUTLINE, _LOWER, _TEXT = (0, 255, 0), (0, 0, 255), (0, 255, 255)  # BGR
_FINER = 16  # OpenCV takes coordinates in sixteenths of a pixel


def draw_detections(pixels: Pixels, order: str, found: Sequence[Detection]) -> Pixels:
    """The image as bgr8 with outlines and names.

    A tag's lower side is red, as is the ground point of another object, if known.

    Args:
        pixels: gray or colour, 8 or 16 bits.
        order: of the channels, ``BGR`` or ``RGB``.
        found: the detections in this image.
    """
    shown = to_bgr(to_8_bit(pixels), order)
    drawn = shown.copy() if shown is pixels else shown
    thick = max(1, round(min(drawn.shape[:2]) / 400))
    for one in found:
        outline = one.outline_uv
        _line(drawn, outline, _OUTLINE, thick, closed=True)
        is_tag = bool(len(one.corners_uv))
        if is_tag:
            _line(drawn, outline[:2], _LOWER, thick, closed=False)
        elif one.point_uv is not None:
            cv2.drawMarker(drawn, tuple(one.point_uv.round().astype(int).tolist()), _LOWER)
        left, top = outline.min(axis=0)
        place = (round(left), round(max(top - 4, 12)))
        text = one.class_id if is_tag else one.label
        cv2.putText(drawn, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.5 * thick, _TEXT, thick)
    return drawn


def _line(
    image: Pixels, points_uv: Floats, color: tuple[int, int, int], thick: int, *, closed: bool
) -> None:
    places = [(points_uv * _FINER).round().astype(np.int32)]
    cv2.polylines(image, places, closed, color, thick, cv2.LINE_AA, shift=4)

"""Pixels of cameras that share their colours with their neighbours."""

from __future__ import annotations

import cv2
import numpy as np

from ros_visualise.data.header import Pixels


def yuv422_to_bgr(packed: Pixels, order: str) -> Pixels:
    """BGR of two bytes per pixel, where two neighbours share their colour.

    Args:
        packed: (height, width, 2), of an even width.
        order: of the bytes of two pixels, ``UYVY`` or ``YUYV``.
    """
    return cv2.cvtColor(packed, getattr(cv2, f"COLOR_YUV2BGR_{order}"))


def planes_to_bgr(rows: Pixels, kind: str) -> Pixels:
    """BGR of one byte of gray per pixel, and after all of them pairs of bytes for the colours.

    Args:
        rows: of nv12 and nv21 (height * 3/2, width), both even, a pair for 2x2 pixels; of nv24
            (height * 3, width), a pair for each.
        kind: ``nv12``, ``nv21`` or ``nv24``.
    """
    if kind != "nv24":
        return cv2.cvtColor(rows, getattr(cv2, f"COLOR_YUV2BGR_{kind.upper()}"))
    height, width = len(rows) // 3, rows.shape[1]
    gray, colors = rows[:height], rows[height:].reshape(height, 2 * width)
    doubled = np.concatenate([gray.repeat(2, axis=0).repeat(2, axis=1), colors])  # is nv12 then
    return np.ascontiguousarray(cv2.cvtColor(doubled, cv2.COLOR_YUV2BGR_NV12)[::2, ::2])

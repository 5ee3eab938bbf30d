"""Encodings of pixels, and pixels that are computed on demand."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from ros_visualise.data.header import Pixels, read_only

_BAYER = ("rggb", "bggr", "gbrg", "grbg")

ENCODINGS: dict[str, tuple[str, int]] = {
    "mono8": ("uint8", 1),
    "mono16": ("uint16", 1),
    "bgr8": ("uint8", 3),
    "rgb8": ("uint8", 3),
    "bgra8": ("uint8", 4),
    "rgba8": ("uint8", 4),
    "bgr16": ("uint16", 3),
    "rgb16": ("uint16", 3),
    "bgra16": ("uint16", 4),
    "rgba16": ("uint16", 4),
    **{f"bayer_{pattern}8": ("uint8", 1) for pattern in _BAYER},
    **{f"bayer_{pattern}16": ("uint16", 1) for pattern in _BAYER},
}
"""Gray and colours: name in sensor_msgs/image_encodings -> (numpy dtype, channels)."""

_COLORLESS = ("8UC2", "16UC1", "16UC2")  # OpenCV's other unsigned types are gray or colours

_TYPES = {"8S": "int8", "16S": "int16", "32S": "int32", "32F": "float32", "64F": "float64"}

MEASUREMENTS: dict[str, tuple[str, int]] = {
    **{name: (f"uint{name.partition('U')[0]}", int(name[-1])) for name in _COLORLESS},
    **{
        f"{name}C{channels}": (dtype, channels)
        for name, dtype in _TYPES.items()
        for channels in (1, 2, 3, 4)
    },
}
"""Measurements in place of gray or colours, as in `ENCODINGS`.

Depth is ``32FC1`` in metres, NaN if unknown, or ``16UC1`` in millimetres, 0 if unknown (REP 118);
``mono16`` has the same bytes and is gray.
"""


class Deferred:
    """Pixels that are computed once, on first access from any thread.

    Args:
        shape: (height, width) or (height, width, channels) of the array that ``make`` returns.
        dtype: its type.
        make: called at most once.
    """

    def __init__(
        self, shape: tuple[int, ...], dtype: npt.DTypeLike, make: Callable[[], Pixels]
    ) -> None:
        self.shape = shape
        self.dtype = np.dtype(dtype)
        self._make: Callable[[], Pixels] | None = make
        self._pixels: Pixels | None = None
        self._lock = threading.Lock()

    @property
    def nbytes(self) -> int:
        """Bytes of the array."""
        return math.prod(self.shape) * self.dtype.itemsize

    def __call__(self) -> Pixels:
        if self._pixels is None:
            with self._lock:
                if self._make is not None:
                    self._pixels = read_only(self._make())
                    self._make = None  # frees its inputs
        assert self._pixels is not None
        return self._pixels

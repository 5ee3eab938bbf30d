"""Images and the calibration of the camera that took them."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from ros_visualise.data.header import Header, Pixels, read_only

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
"""Numbers that are neither gray nor colours, as `ENCODINGS`.

Depth is ``32FC1`` in metres, NaN where there is none, or ``16UC1`` in millimetres, there 0 (REP
118); ``mono16`` has the same bytes and is gray.
"""


class Deferred:
    """Pixels that are made when somebody first asks for them, once, whichever thread asks.

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

    def __call__(self) -> Pixels:
        if self._pixels is None:
            with self._lock:
                if self._make is not None:
                    self._pixels = read_only(self._make())
                    self._make = None  # lets go of what it was made from
        assert self._pixels is not None
        return self._pixels


@dataclass(frozen=True, eq=False)
class CameraInfo:
    """A pinhole camera's calibration, as sensor_msgs/CameraInfo has it.

    ``K`` is 3x3, ``R`` 3x3 and ``P`` 3x4, row-major and in pixels, origin at the centre of the
    top-left pixel; ``D`` are the distortion coefficients of ``distortion_model``. The calibration
    that goes with an image has the image's header.
    """

    height: int
    width: int
    K: npt.NDArray[np.float64]
    D: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros(5))
    R: npt.NDArray[np.float64] = field(default_factory=lambda: np.eye(3))
    P: npt.NDArray[np.float64] | None = None
    distortion_model: str = "plumb_bob"
    header: Header = Header()

    @classmethod
    def uncalibrated(cls, height: int, width: int) -> CameraInfo:
        """What ROS says of a camera that nobody has calibrated: its size, and ``K`` all zero."""
        zero = np.zeros((3, 4))
        return cls(height, width, K=zero[:, :3], D=np.zeros(0), P=zero, distortion_model="")


@dataclass(frozen=True, eq=False)
class Image:
    """One image and, where the camera is calibrated, the calibration that goes with it.

    ``data`` is an array of shape (height, width) for one channel or (height, width, channels), or
    a `Deferred` that makes one; take the array from ``pixels``, which is read-only. ``encoding``
    is one of `ENCODINGS` or `MEASUREMENTS`.

    Raises:
        ValueError: shape or type do not fit the encoding.
    """

    data: Pixels | Deferred
    encoding: str
    header: Header = Header()
    camera_info: CameraInfo | None = None

    def __post_init__(self) -> None:
        known = ENCODINGS if self.encoding in ENCODINGS else MEASUREMENTS
        if self.encoding not in known:
            raise ValueError(f"unknown encoding {self.encoding!r}")
        dtype, channels = known[self.encoding]
        depth = self.data.shape[2:] or (1,)
        if self.data.dtype != dtype or depth != (channels,) or len(self.data.shape) > 3:
            raise ValueError(f"{self.encoding} is not {self.data.dtype} of {self.data.shape}")
        if not isinstance(self.data, Deferred):
            object.__setattr__(self, "data", read_only(self.data))

    @property
    def pixels(self) -> Pixels:
        """The pixels: (height, width) or (height, width, channels), read-only."""
        return self.data() if isinstance(self.data, Deferred) else self.data

    @property
    def height(self) -> int:
        """Rows."""
        return int(self.data.shape[0])

    @property
    def width(self) -> int:
        """Columns."""
        return int(self.data.shape[1])

    @property
    def nbytes(self) -> int:
        """Bytes of its pixels."""
        return math.prod(self.data.shape) * self.data.dtype.itemsize

    @property
    def is_color(self) -> bool:
        """More than one channel."""
        return len(self.data.shape) == 3


@dataclass(frozen=True, eq=False)
class CompressedImage:
    """An image as JPEG or PNG; ``format`` is as image_transport writes it."""

    data: npt.NDArray[np.uint8]
    format: str
    header: Header = Header()

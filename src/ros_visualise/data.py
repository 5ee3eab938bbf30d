"""The messages that travel between nodes: frozen dataclasses on numpy arrays.

A message is never changed after it was made, so it passes between threads by reference.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.params import Value

Pixels = npt.NDArray[Any]
Floats = npt.NDArray[np.float64]

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
    **{f"bayer_{pattern}8": ("uint8", 1) for pattern in _BAYER},
    **{f"bayer_{pattern}16": ("uint16", 1) for pattern in _BAYER},
}
"""Encoding name of sensor_msgs/image_encodings -> (numpy dtype, channels)."""


@dataclass(frozen=True)
class Header:
    """When and where a message was taken.

    ``stamp_ns`` is the time of capture in nanoseconds; ``frame_id`` the frame of the data, for an
    image the camera's optical frame (z forward, x right, y down).
    """

    stamp_ns: int = 0
    frame_id: str = ""


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
                    self._pixels = _read_only(self._make())
                    self._make = None  # lets go of what it was made from
        assert self._pixels is not None
        return self._pixels


@dataclass(frozen=True, eq=False)
class CameraInfo:
    """A pinhole camera's calibration, as sensor_msgs/CameraInfo has it.

    ``K`` is 3x3, ``R`` 3x3 and ``P`` 3x4, row-major and in pixels, origin at the centre of the
    top-left pixel; ``D`` are the distortion coefficients of ``distortion_model``.
    """

    height: int
    width: int
    K: npt.NDArray[np.float64]
    D: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros(5))
    R: npt.NDArray[np.float64] = field(default_factory=lambda: np.eye(3))
    P: npt.NDArray[np.float64] | None = None
    distortion_model: str = "plumb_bob"

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
    is one of `ENCODINGS`.

    Raises:
        ValueError: shape or type do not fit the encoding.
    """

    data: Pixels | Deferred
    encoding: str
    header: Header = Header()
    camera_info: CameraInfo | None = None

    def __post_init__(self) -> None:
        if self.encoding not in ENCODINGS:
            raise ValueError(f"unknown encoding {self.encoding!r}")
        dtype, channels = ENCODINGS[self.encoding]
        depth = self.data.shape[2:] or (1,)
        if self.data.dtype != dtype or depth != (channels,) or len(self.data.shape) > 3:
            raise ValueError(f"{self.encoding} is not {self.data.dtype} of {self.data.shape}")
        if not isinstance(self.data, Deferred):
            object.__setattr__(self, "data", _read_only(self.data))

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


@dataclass(frozen=True, eq=False)
class PoseStamped:
    """Where something is in the frame of its header: position (3,) in metres, quaternion (4,)."""

    position_xyz: Floats
    quat_xyzw: Floats
    header: Header = Header()

    def __post_init__(self) -> None:
        _keep(self, position_xyz=(3,), quat_xyzw=(4,))


@dataclass(frozen=True, eq=False)
class Odometry:
    """A pose in the frame of its header, and velocities in the frame ``child_frame_id``.

    ``position_xyz`` (3,) in metres and ``quat_xyzw`` (4,); ``linear_xyz`` (3,) in m/s and
    ``angular_xyz`` (3,) in rad/s; covariances 6x6 in the order x, y, z, and rotations about them.
    """

    position_xyz: Floats
    quat_xyzw: Floats
    linear_xyz: Floats = field(default_factory=lambda: np.zeros(3))
    angular_xyz: Floats = field(default_factory=lambda: np.zeros(3))
    pose_covariance: Floats = field(default_factory=lambda: np.zeros((6, 6)))
    twist_covariance: Floats = field(default_factory=lambda: np.zeros((6, 6)))
    child_frame_id: str = ""
    header: Header = Header()

    def __post_init__(self) -> None:
        _keep(self, position_xyz=(3,), quat_xyzw=(4,), linear_xyz=(3,), angular_xyz=(3,))
        _keep(self, pose_covariance=(6, 6), twist_covariance=(6, 6))


@dataclass(frozen=True, eq=False)
class Path:
    """Poses in the frame of its header, in the order in which they were passed.

    ``stamps_ns`` (N,), ``positions_xyz`` (N, 3) in metres, ``quats_xyzw`` (N, 4).
    """

    stamps_ns: npt.NDArray[np.int64]
    positions_xyz: Floats
    quats_xyzw: Floats
    header: Header = Header()

    def __post_init__(self) -> None:
        count = len(self.stamps_ns)
        _keep(self, np.int64, stamps_ns=(count,))
        _keep(self, positions_xyz=(count, 3), quats_xyzw=(count, 4))

    @property
    def nbytes(self) -> int:
        """Bytes of its poses."""
        return self.stamps_ns.nbytes + self.positions_xyz.nbytes + self.quats_xyzw.nbytes


@dataclass(frozen=True)
class ParameterEvent:
    """Parameters of one node at a time: ``new`` as it starts, ``changed`` when one is moved."""

    node: str
    new: Mapping[str, Value] = field(default_factory=dict)
    changed: Mapping[str, Value] = field(default_factory=dict)
    header: Header = Header()


MESSAGES: tuple[type, ...] = (Image, Odometry, PoseStamped, Path, ParameterEvent)
"""What can travel on a topic: each has a `Header`."""


def _keep(message: Any, dtype: npt.DTypeLike = np.float64, **shapes: tuple[int, ...]) -> None:
    """Make fields of a frozen message read-only arrays of that type and these shapes.

    Raises:
        ValueError: one is of another shape.
    """
    for name, shape in shapes.items():
        array = np.asarray(getattr(message, name), dtype)
        if array.shape != shape:
            raise ValueError(f"{type(message).__name__}.{name} is {array.shape}, not {shape}")
        object.__setattr__(message, name, _read_only(array))


def _read_only(pixels: Pixels) -> Pixels:
    view: Pixels = pixels.view()
    view.flags.writeable = False
    return view

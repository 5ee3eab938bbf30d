"""Point clouds <-> sensor_msgs/msg/PointCloud2, whatever the layout of their bytes."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.core.message import Message
from ros_visualise.data.fields import Fields, header, read_header
from ros_visualise.data.header import Header, read_only

_FORMATS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""Number of a type in sensor_msgs/msg/PointField -> NumPy's name for it."""

_NUMBERS = {name: number for number, name in _FORMATS.items()}


@dataclass(frozen=True, eq=False)
class PointCloud(Message):
    """Points in the frame of the header, with whatever was measured at each.

    ``points`` is a structured array, (N,) or (height, width) where they form an image; its fields
    are those of sensor_msgs/PointCloud2: ``x``, ``y`` and ``z`` in metres, often ``intensity``, or
    ``rgb``. Other layouts of the bytes, with gaps and in any order, are kept as they are.
    """

    type_name = "sensor_msgs/msg/PointCloud2"
    waiting = 1
    plotted = False

    points: npt.NDArray[np.void]
    is_dense: bool = True
    header: Header = Header()

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", read_only(self.points))

    @property
    def xyz(self) -> npt.NDArray[np.float32]:
        """(N, 3), a copy; points that are no numbers included."""
        columns = [self.points[name].ravel() for name in ("x", "y", "z")]
        return np.stack(columns, axis=1).astype(np.float32, copy=False)

    def fields(self) -> dict[str, Any]:
        """Fields of the ROS message; points are not copied if possible.

        Raises:
            ValueError: the points have a field that the message cannot store.
        """
        points = np.ascontiguousarray(self.points)
        order = _byte_order(points.dtype)
        if order is None:
            points, order = points.astype(points.dtype.newbyteorder("<")), "<"
        height, width = points.shape if points.ndim == 2 else (1, points.size)
        step = points.dtype.itemsize
        return {
            "header": header(self.header),
            "height": height,
            "width": width,
            "fields": [_write_field(*one) for one in _fields(points.dtype)],
            "is_bigendian": order == ">",
            "point_step": step,
            "row_step": step * width,
            "data": points.reshape(-1).view(np.uint8) if points.nbytes else np.zeros(0, np.uint8),
            "is_dense": self.is_dense,
        }

    @classmethod
    def read(cls, message: Any) -> PointCloud:
        """The points in a ROS message, not copied; several rows make an image of points.

        Raises:
            ValueError: contradictory sizes, fields or bytes.
        """
        height, width = int(message.height), int(message.width)
        dtype = _read_layout(message, is_empty=not height * width)
        if height * width and not dtype.itemsize:
            raise ValueError(f"a cloud of {width}x{height} points, each of 0 bytes")
        data = np.frombuffer(message.data, np.uint8)
        row_step = int(message.row_step) or dtype.itemsize * width
        if row_step < dtype.itemsize * width or data.size != row_step * height:
            raise ValueError(
                f"a cloud of {width}x{height} points of {dtype.itemsize} bytes in rows of"
                f" {row_step} needs {max(row_step, dtype.itemsize * width) * height} bytes,"
                f" but the message holds {data.size}"
            )
        shape = (height, width) if height > 1 else (height * width,)
        strides = (row_step, dtype.itemsize) if height > 1 else (dtype.itemsize,)
        points: npt.NDArray[np.void] = (
            np.ndarray(shape, dtype, data, strides=strides) if data.size else np.zeros(shape, dtype)
        )
        return cls(points, bool(message.is_dense), read_header(message.header))


def _read_layout(message: Any, is_empty: bool) -> np.dtype[np.void]:
    """The type of one point; fields without a name are padding."""
    order = ">" if message.is_bigendian else "<"
    named = [one for one in message.fields if one.name]
    formats = [_read_format(one, order) for one in named]
    offsets = [int(one.offset) for one in named]
    needed = max(
        (o + np.dtype(f).itemsize for o, f in zip(offsets, formats, strict=True)), default=0
    )
    size = int(message.point_step)
    if needed > size and not is_empty:
        raise ValueError(f"the fields of a point need {needed} bytes, but the step is {size}")
    names = [str(one.name) for one in named]
    if len(set(names)) < len(names):
        raise ValueError(f"fields of a point share a name: {', '.join(names)}")
    return np.dtype(
        {
            "names": names,
            "formats": formats,
            "offsets": offsets,
            "itemsize": max(size, needed),
        }
    )


def _read_format(one: Any, order: str) -> Any:
    if one.datatype not in _FORMATS:
        raise ValueError(f"field {one.name!r} is of type {one.datatype}; supported: 1 to 8")
    kind = order + _FORMATS[one.datatype]
    return (kind, (int(one.count),)) if one.count > 1 else kind  # old drivers write 0 for 1


def _write_field(name: str, kind: np.dtype[Any], offset: int) -> Fields:
    number = _NUMBERS.get(kind.base.str[1:])
    if number is None:
        raise ValueError(
            f"field {name!r} of a cloud is {kind.base}, which PointCloud2 does not support"
        )
    count = math.prod(kind.shape)
    values = {"name": name, "offset": offset, "datatype": number, "count": count}
    return Fields("sensor_msgs/msg/PointField", values)


def _fields(dtype: np.dtype[np.void]) -> list[tuple[str, np.dtype[Any], int]]:
    """Name, type and offset of each."""
    return [(name, kind, offset) for name, (kind, offset, *_) in (dtype.fields or {}).items()]


def _byte_order(dtype: np.dtype[np.void]) -> str | None:
    """``<`` or ``>``; None of fields of both."""
    native = "<" if sys.byteorder == "little" else ">"
    orders = {kind.base.byteorder for _, kind, _ in _fields(dtype)} - {"|"}
    found = {native if order == "=" else order for order in orders}
    return None if len(found) > 1 else next(iter(found), native)

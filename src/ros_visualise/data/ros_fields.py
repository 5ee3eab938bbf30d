"""Tables of the fields of ROS messages, and of the attributes that hold their values."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from operator import attrgetter
from typing import Any, ClassVar, TypeVar

import numpy as np
import numpy.typing as npt

from ros_visualise.core.message import Message
from ros_visualise.data.fields import (
    Columns,
    Fields,
    duration,
    header,
    read_header,
    read_time,
    time,
)
from ros_visualise.data.header import keep_all

T = TypeVar("T", bound="TabledMessage")


def _as_is(value: Any) -> Any:
    return value


class Attribute:
    """One field of a ROS message, held by an attribute of ours.

    Args:
        name: the attribute.
        read: value of the field -> value of the attribute.
        write: the reverse; None: the value is written as it is.
        shape: shape of an array, -1 for any length; None: it is no array.
        dtype: type of the array.
    """

    def __init__(
        self,
        name: str,
        read: Callable[[Any], Any],
        write: Callable[[Any], Any] | None = None,
        shape: tuple[int, ...] | None = None,
        dtype: npt.DTypeLike = np.float64,
    ) -> None:
        self.name, self._read, self._write = name, read, write or _as_is
        self.shape, self.dtype = shape, np.dtype(dtype)

    def read(self, value: Any, found: dict[str, Any]) -> None:
        """Add the attribute to those found."""
        found[self.name] = self._read(value)

    def write(self, message: Any) -> Any:
        """Value of the field in the ROS message for ours."""
        return self._write(getattr(message, self.name))

    def attributes(self) -> Iterator[Attribute]:
        """The attributes that hold it."""
        yield self


class SubMessage:
    """A message inside another, whose fields are held by attributes of the outer one."""

    def __init__(self, type_name: str, **fields: RosField | type) -> None:
        self._type_name, self._fields = type_name, table(**fields)

    def read(self, value: Any, found: dict[str, Any]) -> None:
        """Add the attributes to those found."""
        for name, one in self._fields.items():
            one.read(getattr(value, name), found)

    def attributes_of(self, value: Any) -> dict[str, Any]:
        """The attributes that a part of a ROS message holds."""
        found: dict[str, Any] = {}
        self.read(value, found)
        return found

    def write(self, message: Any) -> Fields:
        """The part of the ROS message for ours."""
        return Fields(self._type_name, {n: one.write(message) for n, one in self._fields.items()})

    def attributes(self) -> Iterator[Attribute]:
        """The attributes that hold it."""
        for one in self._fields.values():
            yield from one.attributes()


class Unused:
    """A field without an attribute: always written with one value, never read."""

    def __init__(self, value: Any) -> None:
        self._value = value

    def read(self, value: Any, found: dict[str, Any]) -> None:
        """Ignore it."""

    def write(self, message: Any) -> Any:
        """The value."""
        return self._value

    def attributes(self) -> Iterator[Attribute]:
        """None."""
        return iter(())


RosField = Attribute | SubMessage | Unused
RosFields = Mapping[str, RosField]
"""Fields of a ROS message by their ROS 2 names; what a version lacks is not written."""


class TabledMessage(Message):
    """A message that is read and written by a table of its fields other than the header."""

    ros_fields: ClassVar[RosFields]
    _arrays: ClassVar[Sequence[tuple[str, np.dtype[Any], tuple[int, ...]]]] = ()

    def __init_subclass__(cls, known: bool = True) -> None:
        super().__init_subclass__(known)
        if "ros_fields" in vars(cls):
            if cls.has_header and "header" in cls.__annotations__:
                cls.ros_fields = {"header": HEADER, **cls.ros_fields}
            every = [one for field in cls.ros_fields.values() for one in field.attributes()]
            cls._arrays = [(o.name, o.dtype, o.shape) for o in every if o.shape is not None]

    def __post_init__(self) -> None:
        keep_all(self, self._arrays)

    def fields(self) -> dict[str, Any]:
        return {name: field.write(self) for name, field in self.ros_fields.items()}

    @classmethod
    def read(cls: type[T], message: Any) -> T:
        found: dict[str, Any] = {}
        for name, field in cls.ros_fields.items():
            if not isinstance(field, Unused):
                field.read(getattr(message, name), found)
        return cls(**found)


HEADER = Attribute("header", read_header, header)


def table(**fields: RosField | type) -> RosFields:
    """Fields of a ROS message; a type stands for an attribute of the field's name and this type."""
    return {n: Attribute(n, one) if isinstance(one, type) else one for n, one in fields.items()}


def stamp(name: str) -> Attribute:
    """A time, held in nanoseconds."""
    return Attribute(name, read_time, time)


def lifetime(name: str) -> Attribute:
    """A duration, held in nanoseconds."""
    return Attribute(name, read_time, duration)


def several(name: str, kind: Any) -> Attribute:
    """Messages of one kind, held as a tuple of ours."""
    return Attribute(
        name,
        lambda messages: tuple(map(kind.read, messages)),
        lambda ours: [Fields(kind.type_name, one.fields()) for one in ours],
    )


def array(name: str, *shape: int, dtype: npt.DTypeLike = np.float64) -> Attribute:
    """An array of numbers; one of variable length is not copied."""
    dtype = np.dtype(dtype)
    make = np.asarray if -1 in shape else np.array

    def read(values: Any) -> npt.NDArray[Any]:
        if isinstance(values, bytes | bytearray | memoryview):
            return np.frombuffer(values, dtype)
        return make(values, dtype).reshape(shape)

    return Attribute(name, read, lambda ours: np.ascontiguousarray(ours).ravel(), shape, dtype)


def numbers(
    name: str, type_name: str, letters: str = "xyz", dtype: npt.DTypeLike = np.float64
) -> Attribute:
    """A message of numbers such as x, y and z, held as an array of these."""
    read, dtype = attrgetter(*letters), np.dtype(dtype)
    return Attribute(
        name,
        lambda value: np.array(read(value), dtype),
        lambda ours: Fields(type_name, dict(zip(letters, ours.tolist(), strict=True))),
        (len(letters),),
        dtype,
    )


def rows(
    name: str, type_name: str, letters: str = "xyz", dtype: npt.DTypeLike = np.float64
) -> Attribute:
    """Messages of numbers such as x, y and z, held as an array with a row for each."""
    read, width = attrgetter(*letters), len(letters)
    return Attribute(
        name,
        lambda values: np.array([read(one) for one in values], dtype).reshape(-1, width),
        lambda ours: columns(type_name, ours, letters),
        (-1, width),
        dtype,
    )


def columns(type_name: str, rows: npt.NDArray[np.floating], letters: str = "xyz") -> Columns:
    """Messages of numbers such as x, y and z, one for each row."""
    return Columns(type_name, len(rows), dict(zip(letters, rows.T.tolist(), strict=True)))


def vector(name: str) -> Attribute:
    """A geometry_msgs/Vector3."""
    return numbers(name, "geometry_msgs/msg/Vector3")


def quaternion(name: str) -> Attribute:
    """A geometry_msgs/Quaternion."""
    return numbers(name, "geometry_msgs/msg/Quaternion", "xyzw")


POSE = SubMessage(
    "geometry_msgs/msg/Pose",
    position=numbers("position_xyz", "geometry_msgs/msg/Point"),
    orientation=quaternion("quat_xyzw"),
)
TWIST = SubMessage(
    "geometry_msgs/msg/Twist", linear=vector("linear_xyz"), angular=vector("angular_xyz")
)


def pose_with_covariance(covariance: str) -> SubMessage:
    """A pose, and its covariance (6, 6) in the order x, y, z and the rotations about them."""
    return SubMessage(
        "geometry_msgs/msg/PoseWithCovariance", pose=POSE, covariance=array(covariance, 6, 6)
    )


def twist_with_covariance(covariance: str) -> SubMessage:
    """Velocities, and their covariance (6, 6) in the order of linear and angular velocity."""
    return SubMessage(
        "geometry_msgs/msg/TwistWithCovariance", twist=TWIST, covariance=array(covariance, 6, 6)
    )

"""Our data <-> ROS messages: one table, and whoever calls brings the message classes.

    message = to_message(image, typestore.types)
    image = from_message(message, Image)

``types`` maps names as ``sensor_msgs/msg/Image`` to classes that are made from keywords, as a
rosbags typestore's ``types`` does. The table holds the ROS 2 names of the fields in lower case;
what a version of a message names differently (``K`` and ``k``) or lacks is found out here.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from enum import Enum
from typing import Any, NamedTuple, TypeVar

import numpy as np

from ros_visualise.data import ENCODINGS, CameraInfo, Header, Image, ParameterEvent, Pixels
from ros_visualise.params import Value

T = TypeVar("T")
Types = Mapping[str, Callable[..., Any]]

_NS = 1_000_000_000


class _Fields(NamedTuple):
    """A message before its class is known: the name of its type, and its fields."""

    type_name: str
    values: dict[str, Any]


class _Row(NamedTuple):
    type_name: str
    write: Callable[[Any, Header], dict[str, Any]]
    read: Callable[[Any], Any]


def type_name(data_class: type) -> str:
    """The ROS type for a class of ours: ``sensor_msgs/msg/Image`` for `Image`."""
    return _TABLE[data_class].type_name


def data_class(type_name: str) -> type | None:
    """Our class for a ROS type, or None where there is none."""
    return next((cls for cls, row in _TABLE.items() if row.type_name == type_name), None)


def to_message(data: Any, types: Types, header: Header | None = None) -> Any:
    """The ROS message for ``data``.

    The pixels of an image are passed on as they lie in memory, without a copy.

    Args:
        data: one of our messages.
        types: ROS type name -> class.
        header: for a `CameraInfo`, which has none of its own: that of its image.
    """
    row = _TABLE[type(data)]
    return _build(_Fields(row.type_name, row.write(data, header or Header())), types)


def from_message(message: Any, data_class: type[T]) -> T:
    """Our message for a ROS message of ``type_name(data_class)``.

    Raises:
        ValueError: it contradicts itself, or holds what ``data_class`` cannot.
    """
    read: Callable[[Any], T] = _TABLE[data_class].read
    return read(message)


def _build(value: Any, types: Types) -> Any:
    if isinstance(value, list):
        return [_build(item, types) for item in value]
    if not isinstance(value, _Fields):
        return value
    cls = types[value.type_name]
    there = _field_names(cls)
    known = {there[name]: item for name, item in value.values.items() if name in there}
    return cls(**{name: _build(item, types) for name, item in known.items()})


def _field_names(cls: Any) -> dict[str, str]:
    """The fields of a message class: lower-case name -> its own name."""
    names = getattr(cls, "__slots__", ()) or cls.__dataclass_fields__
    return {name.lower(): name for name in names}


def _time(stamp_ns: int) -> _Fields:
    sec, nanosec = divmod(stamp_ns, _NS)
    return _Fields("builtin_interfaces/msg/Time", {"sec": sec, "nanosec": nanosec})


def _header(header: Header) -> _Fields:
    values = {"seq": 0, "stamp": _time(header.stamp_ns), "frame_id": header.frame_id}
    return _Fields("std_msgs/msg/Header", values)


def _read_time(time: Any) -> int:
    return int(time.sec) * _NS + int(time.nanosec)


def _read_header(header: Any) -> Header:
    return Header(_read_time(header.stamp), str(header.frame_id))


def _write_image(image: Image, _: Header) -> dict[str, Any]:
    pixels = np.ascontiguousarray(image.pixels)
    return {
        "header": _header(image.header),
        "height": image.height,
        "width": image.width,
        "encoding": image.encoding,
        "is_bigendian": int(pixels.itemsize > 1 and sys.byteorder == "big"),
        "step": pixels.nbytes // image.height if image.height else 0,
        "data": pixels.reshape(-1).view(np.uint8),
    }


def _read_image(message: Any) -> Image:
    if message.encoding not in ENCODINGS:
        known = ", ".join(ENCODINGS)
        raise ValueError(f"unknown image encoding {message.encoding!r}; known are {known}")
    pixels = _read_pixels(message, *ENCODINGS[message.encoding])
    return Image(pixels, str(message.encoding), _read_header(message.header))


def _read_pixels(message: Any, dtype: str, channels: int) -> Pixels:
    height, width, step = int(message.height), int(message.width), int(message.step)
    stored = np.dtype(dtype).newbyteorder(">" if message.is_bigendian else "<")
    row = width * channels * stored.itemsize
    flat = np.frombuffer(message.data, np.uint8)
    if step < row or flat.size != step * height:
        raise ValueError(
            f"{message.encoding} of {width}x{height} with a step of {step} bytes needs"
            f" {max(step, row) * height} bytes, but the message holds {flat.size}"
        )
    rows = np.ascontiguousarray(flat.reshape(height, step)[:, :row])
    shape = (height, width) if channels == 1 else (height, width, channels)
    pixels: Pixels = rows.view(stored).reshape(shape).astype(dtype, copy=False)
    return pixels


def _write_camera_info(info: CameraInfo, header: Header) -> dict[str, Any]:
    P = np.column_stack([info.K, np.zeros(3)]) if info.P is None else info.P
    matrices = {"d": info.D, "k": info.K, "r": info.R, "p": P}
    whole_image = dict.fromkeys(("x_offset", "y_offset", "height", "width"), 0)
    return {
        "header": _header(header),
        "height": info.height,
        "width": info.width,
        "distortion_model": info.distortion_model,
        **{name: np.asarray(m, np.float64).ravel() for name, m in matrices.items()},
        "binning_x": 0,
        "binning_y": 0,
        "roi": _Fields("sensor_msgs/msg/RegionOfInterest", {**whole_image, "do_rectify": False}),
    }


def _read_camera_info(message: Any) -> CameraInfo:
    names = _field_names(type(message))

    def matrix(name: str, *shape: int) -> Any:
        return np.array(getattr(message, names[name]), np.float64).reshape(shape)

    return CameraInfo(
        height=int(message.height),
        width=int(message.width),
        K=matrix("k", 3, 3),
        D=matrix("d", -1),
        R=matrix("r", 3, 3),
        P=matrix("p", 3, 4),
        distortion_model=str(message.distortion_model),
    )


_PARAMETER_FIELDS: dict[type, tuple[int, str]] = {
    bool: (1, "bool_value"),
    int: (2, "integer_value"),
    float: (3, "double_value"),
    str: (4, "string_value"),
}
"""Type of a value -> its number in rcl_interfaces/msg/ParameterType, and where it is put."""


def _parameter(name: str, value: Value) -> _Fields:
    plain = value.value if isinstance(value, Enum) else value
    number, field = _PARAMETER_FIELDS[type(plain)]
    values: dict[str, Any] = {unset: cls() for cls, (_, unset) in _PARAMETER_FIELDS.items()}
    values |= {
        "byte_array_value": np.zeros(0, np.uint8),
        "bool_array_value": np.zeros(0, np.bool_),
        "integer_array_value": np.zeros(0, np.int64),
        "double_array_value": np.zeros(0, np.float64),
        "string_array_value": [],
    }
    stored = _Fields("rcl_interfaces/msg/ParameterValue", values | {"type": number, field: plain})
    return _Fields("rcl_interfaces/msg/Parameter", {"name": name, "value": stored})


def _write_parameter_event(event: ParameterEvent, _: Header) -> dict[str, Any]:
    return {
        "stamp": _time(event.header.stamp_ns),
        "node": f"/{event.node}",
        "new_parameters": [_parameter(*item) for item in event.new.items()],
        "changed_parameters": [_parameter(*item) for item in event.changed.items()],
        "deleted_parameters": [],
    }


def _read_parameter_event(message: Any) -> ParameterEvent:
    return ParameterEvent(
        node=str(message.node).removeprefix("/"),
        new={p.name: _read_value(p) for p in message.new_parameters},
        changed={p.name: _read_value(p) for p in message.changed_parameters},
        header=Header(_read_time(message.stamp)),
    )


def _read_value(parameter: Any) -> Value:
    for cls, (number, field) in _PARAMETER_FIELDS.items():
        if parameter.value.type == number:
            value: Value = cls(getattr(parameter.value, field))
            return value
    raise ValueError(f"parameter {parameter.name}: only bool, integer, double and string are read")


_TABLE: dict[type, _Row] = {
    Image: _Row("sensor_msgs/msg/Image", _write_image, _read_image),
    CameraInfo: _Row("sensor_msgs/msg/CameraInfo", _write_camera_info, _read_camera_info),
    ParameterEvent: _Row(
        "rcl_interfaces/msg/ParameterEvent", _write_parameter_event, _read_parameter_event
    ),
}

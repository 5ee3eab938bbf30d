"""KITTI's car and its sensors, as a figure and in 3D.

Positions are metres ahead of the IMU, to its left and above the road, approximately from: Geiger et
al., Vision meets Robotics: The KITTI Dataset, 2013, figure 3. The car is a VW Passat estate.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats, Header, Marker, MarkerArray, MarkerType
from ros_visualise.plotting.colors import BLUE, GRAY, GREEN, ORANGE, RED, Color
from ros_visualise.plotting.figure import Figure

_SIZE = np.array([4.8, 1.8, 1.5])
_MIDDLE = np.array([0.6, 0.16])  # centre of the car, from above
_IMU_UP = 0.93
_WHEEL_M = 0.64
_BASELINE_M = 0.54
_FAR_M = 4.0  # drawn range of the sensors
_LETTERS_M = 0.11


class _Sensor(NamedTuple):
    name: str
    place: tuple[float, float, float]
    color: Color
    size: tuple[float, float, float]
    label: tuple[float, float, float]
    """Position of its name in 3D, so that names do not overlap."""


_VELODYNE = _Sensor("Velodyne", (0.81, 0.32, 1.73), RED, (0.22, 0.22, 0.28), (0.4, 0.4, 2.8))
_CAMERAS = (
    _Sensor("gray cameras", (1.08, 0.32, 1.65), BLUE, (0.12, 0.05, 0.05), (1.6, 1.6, 2.0)),
    _Sensor("colour cameras", (1.08, 0.26, 1.65), GREEN, (0.12, 0.05, 0.05), (1.8, -1.2, 2.0)),
)
_INERTIAL = _Sensor("GPS and IMU", (0.0, 0.0, _IMU_UP), ORANGE, (0.3, 0.2, 0.15), (-0.6, 0, 2.0))
_SENSORS = (_VELODYNE, *_CAMERAS, _INERTIAL)


def figure() -> Figure:
    """The car from the side and from above; one metre is 100 units."""
    drawn = Figure(640, 530)
    scale, middle = 100.0, 320.0
    length, width, height = _SIZE * scale
    left = middle - length / 2
    for name, top, tall in (
        ("from the side, with heights above the road", 210 - height, height),
        ("from above", 270.0, width),
    ):
        drawn.text(left + 8, top + 24, name, 17)
        drawn.outline((left, top, length, tall), GRAY, 2)
    drawn.line(np.array([[left - 40, 230], [left + length + 40, 230]]), GRAY, 1)
    for x in (left + 90, left + length - 90):
        drawn.dot(x, 210, 20, GRAY)
    for number, sensor in enumerate(_SENSORS):
        ahead, _, up = sensor.place
        x = middle + (ahead - _MIDDLE[0]) * scale
        drawn.dot(x, 230 - up * scale, 7, sensor.color)
        for place in _asides(sensor):
            drawn.dot(x, 270 + width / 2 - (place - _MIDDLE[1]) * scale, 7, sensor.color)
        row, column = divmod(number, 2)
        drawn.dot(left + 240 * column + 6, 480 + 26 * row, 6, sensor.color)
        drawn.text(left + 240 * column + 20, 486 + 26 * row, f"{sensor.name}, {up:.2f} m", 17)
    return drawn


def markers(frame_id: str) -> MarkerArray:
    """The transparent car in 3D, with its sensors and their views, in its IMU's frame."""
    shapes = (*_body(), *_rays(), *(one for sensor in _SENSORS for one in _named(sensor)))
    header = Header(0, frame_id)
    return MarkerArray(
        tuple(
            replace(shape, id=number, frame_locked=True, header=header)
            for number, shape in enumerate(shapes)
        )
    )


def _body() -> Iterator[Marker]:
    clear = _rgba(GRAY, 0.35)
    x, y = _MIDDLE
    yield Marker(MarkerType.CUBE, _at(x, y, 0.65), scale_xyz=np.array([4.8, 1.8, 0.6]),
                 color_rgba=clear)  # fmt: skip
    yield Marker(MarkerType.CUBE, _at(x - 0.3, y, 1.22), scale_xyz=np.array([2.9, 1.6, 0.54]),
                 color_rgba=clear)  # fmt: skip
    lying = np.array([np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    size = np.array([_WHEEL_M, _WHEEL_M, 0.2])
    for ahead in (-1.35, 1.35):
        for aside in (-0.85, 0.85):
            place = _at(x + ahead, y + aside, _WHEEL_M / 2)
            yield Marker(MarkerType.CYLINDER, place, lying, size, _rgba((50, 50, 50)))


def _asides(sensor: _Sensor) -> list[float]:
    """Its distance to the left; both for a pair."""
    aside = sensor.place[1]
    return [aside, aside - _BASELINE_M] if sensor in _CAMERAS else [aside]


def _named(sensor: _Sensor) -> Iterator[Marker]:
    """A sensor, or a pair of cameras, with its name."""
    kind = MarkerType.CYLINDER if sensor is _VELODYNE else MarkerType.CUBE
    ahead, _, up = sensor.place
    places = [_at(ahead, aside, up) for aside in _asides(sensor)]
    for place in places:
        yield Marker(kind, place, scale_xyz=np.array(sensor.size), color_rgba=_rgba(sensor.color))
    label, letters = _at(*sensor.label), np.full(3, _LETTERS_M)
    yield Marker(MarkerType.TEXT_VIEW_FACING, label, scale_xyz=letters, text=sensor.name)
    yield _lines([(places[0], label - [0, 0, _LETTERS_M])], sensor.color)


def _rays() -> Iterator[Marker]:
    """Rays of the rotating laser, and the corners of a camera's view."""
    around = np.radians(np.arange(0, 360, 10))
    down = np.full(len(around), -0.2)
    rays = np.stack([np.cos(around), np.sin(around), down], axis=1) * _FAR_M
    start = _at(*_VELODYNE.place)
    yield _lines([(start, start + ray) for ray in rays], RED)
    start = _at(*_CAMERAS[0].place)
    half_wide, half_high = 0.71, 0.26  # of a picture, at 1 m
    corners = [[1, y * half_wide, z * half_high] for y, z in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    ends = start + _FAR_M * np.array(corners)
    edges = [*((start, end) for end in ends), *zip(ends, np.roll(ends, 1, axis=0), strict=True)]
    yield _lines(edges, BLUE)


def _lines(pairs: list[tuple[Floats, Floats]], color: Color) -> Marker:
    points = np.array(pairs).reshape(-1, 3)
    thin = np.array([0.01, 0, 0])
    return Marker(MarkerType.LINE_LIST, scale_xyz=thin, color_rgba=_rgba(color), points_xyz=points)


def _at(ahead: float, aside: float, up: float) -> Floats:
    """A position in the IMU's frame."""
    return np.array([ahead, aside, up - _IMU_UP])


def _rgba(color: Color, alpha: float = 1.0) -> np.ndarray[tuple[int], np.dtype[np.float32]]:
    return np.array([*(one / 255 for one in color), alpha], np.float32)

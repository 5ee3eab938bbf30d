"""Units of fields, by their names in ROS types, and of their derivatives and integrals."""

from __future__ import annotations

import re

_UNITS = [
    (r"(^|\.)(stamp|time_increment|scan_time|time_ref)$", "s"),
    (r"linear_acceleration|acceleration|(^|\.)accel", "m/s²"),
    (r"angular_velocity|(^|\.)angular\.|(^|\.)gyro|(roll|pitch|yaw)(speed|_rate)", "rad/s"),
    (r"(^|\.)linear\.|ground_?speed|(^|\.)v[xyz]$", "m/s"),
    (r"(^|\.)(position|translation|origin|offset)\.|(^|\.)(altitude|height_m|alt)$", "m"),
    (r"(^|\.)ranges|(^|\.)range(_min|_max)?$", "m"),
    (r"(^|\.)(latitude|longitude|lat|lon)$", "°"),
    (r"(^|\.)angle_(min|max|increment)$|(^|\.)(roll|pitch|yaw|heading)$", "rad"),
    (r"(^|\.)(voltage|voltage_v|cell_voltage|voltage_cell_v)$", "V"),
    (r"(^|\.)(current|current_a)$", "A"),
    (r"(^|\.)(charge|capacity|design_capacity)$", "Ah"),
    (r"(^|\.)force$|(^|\.)force\.", "N"),
    (r"(^|\.)(torque|effort)$|(^|\.)torque\.", "N·m"),
    (r"(^|\.)magnetic_field\.", "T"),
    (r"(^|\.)temperature$", "°C"),
    (r"(^|\.)fluid_pressure$", "Pa"),
]
_PATTERNS = [(re.compile(pattern), unit) for pattern, unit in _UNITS]


def unit_of(path: str) -> str:
    """The unit of a field by its path, as ROS's messages have it; empty if unknown."""
    if "covariance" in path:
        return ""
    bare = re.sub(r"\[\d+\]", "", path)
    return next((unit for pattern, unit in _PATTERNS if pattern.search(bare)), "")


def per_second(unit: str) -> str:
    """The unit of a derivative."""
    if not unit:
        return ""
    if unit.endswith("/s²"):
        return unit[:-1] + "³"
    return unit + "²" if unit.endswith("/s") else unit + "/s"


def times_second(unit: str) -> str:
    """The unit of an integral."""
    if unit.endswith("/s²"):
        return unit[:-1]
    return unit[:-2] if unit.endswith("/s") else unit and unit + "·s"

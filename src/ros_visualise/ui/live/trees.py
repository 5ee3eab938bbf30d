"""Any message as JSON: the tree of its fields, or its numbers by name."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ros_visualise.data.fields import field_names
from ros_visualise.messages.numeric_fields import numeric_fields
from ros_visualise.messages.recorded import as_ros

_FIRST = 50  # elements of an array that are shown
_MOST = 5000  # values of a message
_LONGEST = 4000  # characters of a text


def tree_of(message: Any) -> Any:
    """The fields of a message by their ROS names; of long arrays the first ones and the length."""
    return _Writer().write(as_ros(message))


def fields_of(message: Any) -> dict[str, float]:
    """The numbers of a message by their paths in its ROS type."""
    return numeric_fields(as_ros(message))


class _Writer:
    """Writes one message; it stops where there are very many values."""

    def __init__(self) -> None:
        self._count = 0

    def write(self, value: Any) -> Any:
        self._count += 1
        if isinstance(value, bool | np.bool_):
            return bool(value)
        if isinstance(value, int | np.integer):
            return int(value) if abs(int(value)) < 2**53 else str(value)
        if isinstance(value, float | np.floating):
            return float(value) if math.isfinite(value) else str(value)
        if isinstance(value, str):
            return value if len(value) <= _LONGEST else f"{value[:_LONGEST]}..."
        if isinstance(value, bytes | bytearray | memoryview | list | tuple | np.ndarray):
            return self._write_array(value)
        names = field_names(value.__class__)
        return {name: self.write(getattr(value, own)) for name, own in names.items()}

    def _write_array(self, values: Any) -> Any:
        first = []
        for value in values[:_FIRST]:
            if self._count >= _MOST:
                break
            first.append(self.write(value))
        if len(first) == len(values):
            return first
        return {"first": first, "length": len(values)}

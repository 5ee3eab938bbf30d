"""Numeric fields of any ROS message, by name: what can be plotted.

    numeric_fields(message)["pose.pose.position.x"]
    number_at("pose.covariance[35]", message)

Messages are those of rosbags or genpy, of any type. Each class of messages is analysed once, with
its first message.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from functools import lru_cache
from numbers import Real
from operator import attrgetter
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from ros_visualise.data.fields import field_names, read_time

_LONGEST = 4096  # elements of an array that are single numbers
_LONGEST_BYTES = 64  # longer ones hold something else
_NS = 1e-9
_STEP = re.compile(r"\.?([A-Za-z]\w*)|\[(\d{1,9})\]")

Found = dict[str, float]


class _Leaf(NamedTuple):
    """A numeric field: its path, and the function that adds its numbers to those found."""

    path: str
    add: Callable[[Found, str, Any], None]


class _Plan(NamedTuple):
    leaves: list[_Leaf]
    read: Callable[[Any], tuple[Any, ...]]


_PLANS: WeakKeyDictionary[type, _Plan] = WeakKeyDictionary()


def numeric_fields(message: Any) -> dict[str, float]:
    """Each number of a message by its path, such as ``pose.pose.position.x`` or ``covariance[3]``.

    Numbers, truth values as 0 and 1, times and durations in seconds, and the first 4096 elements of
    arrays of them and of messages, in the order of its definition; more than 64 bytes are skipped.
    """
    plan = _PLANS.get(type(message))
    if plan is None:
        plan = _PLANS[type(message)] = _plan(message)
    found: Found = {}
    for (path, add), value in zip(plan.leaves, plan.read(message), strict=True):
        add(found, path, value)
    return found


def number_at(path: str, message: Any) -> float:
    """The number of a path that `numeric_fields` gave; NaN if this message lacks it."""
    value = message
    try:
        for step in _steps(path):
            value = getattr(value, step) if isinstance(step, str) else value[step]
        if isinstance(value, (Real, np.bool_)):
            return float(value)
        return read_time(value) * _NS
    except (AttributeError, IndexError, KeyError, TypeError, ValueError):
        return math.nan


@lru_cache(1000)
def _steps(path: str) -> list[str | int]:
    """Names of fields and indices of elements; those of other texts lead to no number."""
    return [name or int(index) for name, index in _STEP.findall(path)]


def _plan(message: Any) -> _Plan:
    leaves = list(_leaves(message, ""))
    paths = [leaf.path for leaf in leaves]
    if len(paths) > 1:
        return _Plan(leaves, attrgetter(*paths))
    return _Plan(leaves, lambda one: tuple(attrgetter(path)(one) for path in paths))


def _leaves(message: Any, prefix: str) -> list[_Leaf]:
    found = []
    for name in field_names(message.__class__).values():
        value = getattr(message, name)
        add = _adder(value)
        if add is not None:
            found.append(_Leaf(prefix + name, add))
        elif not isinstance(value, (str, bytes, list, tuple, np.ndarray)):
            found += _leaves(value, f"{prefix}{name}.")
    return found


def _adder(value: Any) -> Callable[[Found, str, Any], None] | None:
    """The function that adds a value; None if it is not numeric."""
    if isinstance(value, (Real, np.bool_)):
        return _add_number
    if isinstance(value, (bytes, list, tuple, np.ndarray)):
        return _add_array
    if isinstance(value, str) or field_names(value.__class__).keys() != {"sec", "nanosec"}:
        return None
    return _add_time


def _add_number(found: Found, path: str, value: Any) -> None:
    found[path] = float(value)


def _add_array(found: Found, path: str, values: Any) -> None:
    is_bytes = isinstance(values, bytes) or getattr(values, "dtype", None) == np.uint8
    if is_bytes and len(values) > _LONGEST_BYTES:
        return
    first = values[:_LONGEST]
    for index, value in enumerate(first.tolist() if isinstance(first, np.ndarray) else first):
        if isinstance(value, (int, float)):
            found[f"{path}[{index}]"] = float(value)
        elif not isinstance(value, str) and len(found) < _LONGEST:
            own = numeric_fields(value)
            found.update({f"{path}[{index}].{name}": number for name, number in own.items()})


def _add_time(found: Found, path: str, value: Any) -> None:
    found[path] = read_time(value) * _NS

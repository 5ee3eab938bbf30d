"""Texts in messages that people may search."""

from __future__ import annotations

from collections.abc import Iterator
from numbers import Real
from typing import Any

import numpy as np

from ros_visualise.data.fields import field_names
from ros_visualise.messages.definitions import has_strings, parts_of
from ros_visualise.messages.recorded import STANDARD, TopicType

_FRAME = "frame_id"
_NAMES = ("encoding", "format", "distortion_model", "file", "function", "topics")
"""Fields that nobody searches."""
_CONSTANT = ("sensor_msgs/msg/PointField", "sensor_msgs/msg/JointState")
"""Types whose texts are always the same."""


def texts_of(message: Any) -> Iterator[str]:
    """The texts of a ROS message that are not empty, without those of frames, formats and files."""
    return (text for text in _strings(message) if text)


def _strings(value: Any) -> Iterator[str]:
    """Texts, also empty ones; an empty array, which may hold some in another message, is one."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, list | tuple):
        yield from (text for one in value for text in _strings(one)) if value else ("",)
    elif not isinstance(value, Real | bytes | np.ndarray | np.generic):
        for name, own in field_names(value.__class__).items():
            if not _is_skipped(name):
                yield from _strings(getattr(value, own))


def may_have_texts(kind: TopicType) -> bool:
    """True if messages of a type have fields that `texts_of` reads; False for unknown types."""
    known = (kind.definitions or STANDARD).store.fielddefs

    def holds(type_name: str) -> bool:
        if type_name in _CONSTANT or type_name not in known:
            return False
        fields = [(name, kind) for name, kind in known[type_name][1] if not _is_skipped(name)]
        return has_strings(fields) or any(map(holds, parts_of(fields)))

    return holds(kind.name)


def _is_skipped(name: str) -> bool:
    return name in _NAMES or name.endswith(_FRAME)

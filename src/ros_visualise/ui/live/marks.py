"""Marks on the timeline: times of a recording with names, kept in a file beside it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from ros_visualise.core.errors import UsageError
from ros_visualise.core.yaml_files import open_yaml, to_yaml
from ros_visualise.sinks.files import write_file

SUFFIX = ".marks.yaml"
"""Added to the name of a recording or film for the file with its marks."""
_MOST, _LONGEST = 1000, 80
_FARTHEST_S = 1e9


class Marks:
    """The marks of one recording: time, s from its start -> name.

    Args:
        source: the recording or film; None keeps the marks in memory only.

    Attributes:
        names: in order of time.

    Raises:
        OpenError, UsageError: its marks cannot be read.
    """

    def __init__(self, source: Path | None = None) -> None:
        self.path = None if source is None else source.with_name(source.name + SUFFIX)
        self.names: dict[float, str] = {}
        if self.path is not None and self.path.exists():
            self.names = _read(self.path)

    def set(self, at_s: float, name: str) -> None:
        """Add or rename a mark; an empty name removes it.

        Raises:
            UsageError: there are too many.
            RosVisualiseError: the file cannot be written; the mark is there until the page ends.
        """
        at_s, name = round(at_s, 3), " ".join(name.split())[:_LONGEST]
        if not name:
            self.names.pop(at_s, None)
        elif at_s not in self.names and len(self.names) >= _MOST:
            raise UsageError(f"there are {_MOST} marks already; remove some first")
        else:
            self.names = dict(sorted({**self.names, at_s: name}.items()))
        if self.path is None:
            return
        marks = [{"time": at, "name": name} for at, name in self.names.items()]
        write_file(self.path, to_yaml({"marks": marks}).encode(), overwrite=True)


def _read(path: Path) -> dict[float, str]:
    advice = "remove it, or put a list of 'time' and 'name' under 'marks'"
    found = open_yaml(path, advice)
    marks: Any = found.get("marks") if isinstance(found, dict) else None
    if not isinstance(marks, list) or not all(map(_is_mark, marks)) or len(marks) > _MOST:
        raise UsageError(f"{path}: not the marks of a recording; {advice}")
    return dict(sorted((float(one["time"]), one["name"][:_LONGEST]) for one in marks))


def _is_mark(one: Any) -> bool:
    if not isinstance(one, dict) or not isinstance(one.get("name"), str):
        return False
    at: Any = one.get("time")
    return type(at) in (int, float) and math.isfinite(at) and 0 <= at <= _FARTHEST_S

"""Marks on the timeline and notes of a recording, kept in a file beside it."""

from __future__ import annotations

import math
import threading
from pathlib import Path
from typing import Any

from ros_visualise.core.errors import UsageError
from ros_visualise.core.yaml_files import open_yaml, to_yaml
from ros_visualise.sinks.files import write_file

SUFFIX = ".marks.yaml"
"""Added to the name of a recording or film for the file with its marks and notes."""
LONGEST_NOTES = 50_000
_MOST, _LONGEST = 1000, 80
_FARTHEST_S = 1e9


class Marks:
    """The marks of one recording: time, s from its start -> name; and its notes.

    Args:
        source: the recording or film; None keeps the marks in memory only.

    Attributes:
        names: in order of time.
        notes: plain text, or Markdown.

    Raises:
        OpenError, UsageError: its marks cannot be read.
    """

    def __init__(self, source: Path | None = None) -> None:
        self.path = None if source is None else source.with_name(source.name + SUFFIX)
        self.names: dict[float, str] = {}
        self.notes = ""
        self._writing = threading.Lock()
        if self.path is not None and self.path.exists():
            self.names, self.notes = _read(self.path)

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
        self._write()

    def add(self, at_s: float) -> None:
        """Add a mark with the next free name, unless one has this time; raises as `set` does."""
        taken, number = {*self.names.values()}, len(self.names) + 1
        while f"Mark {number}" in taken:
            number += 1
        if round(at_s, 3) not in self.names:
            self.set(at_s, f"Mark {number}")

    def note(self, text: str) -> None:
        """Replace the notes.

        Raises:
            UsageError: they are too long.
            RosVisualiseError: the file cannot be written; the notes are there until the page ends.
        """
        if len(text) > LONGEST_NOTES:
            raise UsageError(f"notes: at most {LONGEST_NOTES} letters")
        self.notes = text
        self._write()

    def _write(self) -> None:
        if self.path is None:
            return
        with self._writing:
            marks = [{"time": at, "name": name} for at, name in self.names.items()]
            notes = {"notes": self.notes} if self.notes else {}
            write_file(
                self.path,
                to_yaml({"marks": marks, **notes}).encode(),
                overwrite=True,
            )


def _read(path: Path) -> tuple[dict[float, str], str]:
    advice = "remove it, or put a list of entries with 'time' and 'name' under 'marks'"
    found = open_yaml(path, advice)
    marks: Any = found.get("marks") if isinstance(found, dict) else None
    notes: Any = found.get("notes", "") if isinstance(found, dict) else ""
    is_list = isinstance(marks, list) and all(map(_is_mark, marks)) and len(marks) <= _MOST
    if not is_list or not isinstance(notes, str) or len(notes) > LONGEST_NOTES:
        raise UsageError(f"{path}: not the marks of a recording; {advice}")
    names = dict(sorted((float(one["time"]), one["name"][:_LONGEST]) for one in marks))
    return names, notes


def _is_mark(one: Any) -> bool:
    if not isinstance(one, dict) or not isinstance(one.get("name"), str):
        return False
    at: Any = one.get("time")
    return type(at) in (int, float) and math.isfinite(at) and 0 <= at <= _FARTHEST_S

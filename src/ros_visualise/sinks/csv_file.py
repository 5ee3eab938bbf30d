"""Recording the numbers of topics to a CSV file: a row for each stamp, a column for each field."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from ros_visualise.core.errors import UsageError
from ros_visualise.core.printing import in_seconds
from ros_visualise.messages.numeric_fields import numeric_fields
from ros_visualise.messages.recorded import TopicType, as_ros, recorded_ns
from ros_visualise.sinks.one_file import FileRecorder


def topics_with_numbers(path: Path, topics: Mapping[str, TopicType]) -> list[str]:
    """The topics that a table has by default: those with single numbers; raises UsageError."""
    classes: dict[str, Any] = {topic: kind.data_class for topic, kind in topics.items()}
    found = [topic for topic, one in classes.items() if one.plotted]
    if not found:
        raise UsageError(f"{path}: no topic with numbers to record")
    return found


class CsvRecorder(FileRecorder):
    """Numbers by ``TOPIC:FIELD``, after the time since the first row and the stamp, seconds.

    Messages of equal stamps share a row. The columns are known at the end alone, so that it is
    written then.
    """

    def __init__(self, path: Path, topics: Sequence[str], overwrite: bool, live: bool) -> None:
        super().__init__(path, topics, overwrite, live)
        self._rows = TemporaryFile("w+", encoding="utf-8")  # noqa: SIM115
        self._columns: dict[str, int] = {}
        self._stamp_ns: int | None = None  # of the row that is not written yet
        self._row: dict[int, float] = {}
        self._taken: set[str] = set()  # topics in that row

    def _take(self, topic: str, message: Any, stamp_ns: int | None) -> None:
        stamp_ns = recorded_ns(message) if stamp_ns is None else stamp_ns
        numbers = numeric_fields(as_ros(message))
        if stamp_ns != self._stamp_ns or topic in self._taken:
            self._end_row()
        self._stamp_ns = stamp_ns
        self._taken.add(topic)
        for name, number in numbers.items():
            self._row[self._columns.setdefault(f"{topic}:{name}", len(self._columns))] = number

    def _end(self) -> None:
        self._end_row()
        with self._rows:
            self._write_table()

    def _end_row(self) -> None:
        if self._stamp_ns is None:
            return
        try:
            self._rows.write(f"{json.dumps([self._stamp_ns, [*self._row.items()]])}\n")
        except OSError as error:
            self._closed = True
            raise self._file.give_up(error, self._written) from None
        self._stamp_ns, self._row, self._taken = None, {}, set()

    def _write_table(self) -> None:
        self._write_row(["time", "stamp", *self._columns])
        first_ns: int | None = None
        self._rows.seek(0)
        for line in self._rows:
            stamp_ns, numbers = json.loads(line)
            first_ns = stamp_ns if first_ns is None else first_ns
            cells = [""] * len(self._columns)
            for column, number in numbers:
                cells[column] = repr(number)
            self._write_row([in_seconds(stamp_ns - first_ns), in_seconds(stamp_ns), *cells])

    def _write_row(self, cells: Sequence[str]) -> None:
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerow(cells)
        data = text.getvalue().encode()
        self._file.require_room(len(data))
        self._file.write(data)

"""The folder of a batch: what was asked for, what is done, what failed, and the tables of all.

    plan.jsonl              the options; then each task: its key, its recording, its part
    tasks/KEY/              the tables and files of a task that is done
    tasks/KEY.failed.json   the failure of one that is not
    *.parquet, README.md    the tables of all tasks, and their columns

A task's folder is renamed to its key when it is whole. So a batch that was killed at any moment
goes on where it was, and two batches in one folder do no more than some work twice.
"""

from __future__ import annotations

import json
import os
import shutil
import socket
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ros_visualise.batch.apart import TaskFailure
from ros_visualise.batch.tables import (
    LISTED,
    TABLES,
    Column,
    columns_of,
    connect,
    copy,
    declare,
    quoted,
    registered,
)
from ros_visualise.core.errors import OpenError
from ros_visualise.core.regular_files import open_file, read_file

if TYPE_CHECKING:
    import duckdb

_PLAN, _TASKS, _README = "plan.jsonl", "tasks", "README.md"
_FAILED = ".failed.json"
_MEMORY = 1 << 30  # of DuckDB for sorting; beyond, it uses the disk
FILES = "files"
"""Folder of what tasks recorded and exported: links to it, by the recordings' names."""


class Planned(NamedTuple):
    """A task of a plan; of a recording that cannot be identified the content is empty."""

    key: str
    recording: str
    path: str
    size: int
    content: str
    begin_s: float | None = None
    until_s: float | None = None


class Results:
    """The folder of a batch's results."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.tasks = folder / _TASKS

    def create(self) -> None:
        """Make the folder; raises OpenError."""
        try:
            self.tasks.mkdir(parents=True, exist_ok=True)
            os.path.abspath(self.folder).encode()  # as DuckDB wants it
        except OSError as error:
            raise OpenError(f"{self.folder}: {error.strerror}; choose another folder") from None
        except UnicodeEncodeError:
            raise OpenError(
                f"{self.folder}: its path is not valid UTF-8; choose another folder"
            ) from None

    def write_plan(self, options: Mapping[str, Any], planned: Iterable[Planned]) -> None:
        """Replace the plan."""
        lines = [json.dumps(options), *(json.dumps(one) for one in planned)]
        self.write(_PLAN, "\n".join(lines) + "\n")

    def read_plan(self) -> tuple[dict[str, Any], list[Planned]]:
        """The options and the tasks; raises OpenError if there is no plan here."""
        try:
            with open_file(self.folder / _PLAN) as file:
                options = json.loads(next(file))
                return options, [Planned(*json.loads(line)) for line in file]
        except (OSError, ValueError, TypeError, StopIteration):
            raise OpenError(
                f"{self.folder}: not the results of a batch; give the --out folder of a batch"
            ) from None

    def is_done(self, key: str) -> bool:
        """True if a task is done."""
        return (self.tasks / key).is_dir()

    def failure(self, key: str) -> TaskFailure | None:
        """The failure of a task; None if it is done or was not tried."""
        with suppress(OSError, ValueError, TypeError):
            if not self.is_done(key):
                return TaskFailure(*json.loads(read_file(self.tasks / f"{key}{_FAILED}")))
        return None

    def fail(self, key: str, failure: TaskFailure) -> None:
        """Keep the failure of a task."""
        self.write(f"{_TASKS}/{key}{_FAILED}", json.dumps(failure))

    def failures(self) -> list[dict[str, Any]]:
        """The rows of the table of failures when it was last written."""
        if not self._table("failures").exists():
            return []
        names = [one.name for one in columns_of("failures")]
        with closing(self.open_tables()) as sql:
            found = sql.execute("SELECT * FROM failures").fetchall()
        return [dict(zip(names, row, strict=True)) for row in found]

    def forget(self, key: str) -> None:
        """Forget the result or the failure of a task, so that it is tried again."""
        with suppress(OSError):
            (self.tasks / f"{key}{_FAILED}").unlink()
        shutil.rmtree(self.tasks / key, ignore_errors=True)

    def clean(self) -> None:
        """Delete what killed processes left unfinished on this machine."""
        for path in self.tasks.glob("*.part"):
            host, _, pid = path.name.partition(".")[2].removesuffix(".part").rpartition(".")
            if host == socket.gethostname() and not _runs(int(pid)):
                shutil.rmtree(path, ignore_errors=True)

    def compact(self, planned: Sequence[Planned]) -> dict[str, int]:
        """Write the tables of all tasks that are done; the number of rows of each."""
        done = [one for one in planned if self.is_done(one.key)]
        files = self._task_files({one.key for one in done})
        with closing(connect(_MEMORY, self.folder / ".sort")) as sql:
            rows_planned = [self._plan_row(*one) for one in enumerate(planned)]
            sql.execute(
                f"CREATE TABLE planned AS {registered(sql, 'given', _PLANNED, rows_planned)}"
            )
            rows = {}
            for table, columns in TABLES.items():
                query = _gathered(table, columns, files.get(table, []))
                rows[table] = self._write(sql, table, query)
            for table, query in _LISTING.items():
                rows[table] = self._write(sql, table, query)
        self.write(_README, _readme(rows))
        self._link_files(done)
        return rows

    def _plan_row(self, number: int, one: Planned) -> tuple[Any, ...]:
        failure = self.failure(one.key) or TaskFailure("", "", 0)
        return number, *one, self.is_done(one.key), *failure

    def open_tables(self, suffix: str = "") -> duckdb.DuckDBPyConnection:
        """DuckDB with a view of each table, by its name and a suffix.

        Raises:
            OpenError: no tables in this folder.
        """
        there = [name for name in (*LISTED, *TABLES) if self._table(name).exists()]
        if not there:
            raise OpenError(f"{self.folder}: no tables; run: ros-visualise batch ... --out")
        sql = connect()
        for name in there:
            path = quoted(self._table(name))
            sql.execute(f"CREATE VIEW {name}{suffix} AS SELECT * FROM read_parquet({path})")
        return sql

    def _write(self, sql: duckdb.DuckDBPyConnection, table: str, query: str) -> int:
        path = self._table(table)
        new = path.with_name(f"{table}.{os.getpid()}.part")
        copy(sql, query, new, columns_of(table))
        new.replace(path)
        sql.execute(f"CREATE OR REPLACE VIEW {table} AS SELECT * FROM read_parquet({quoted(path)})")
        found = sql.execute(f"SELECT count(*) FROM {table}").fetchone()
        return int(found[0]) if found else 0

    def _table(self, name: str) -> Path:
        return self.folder / f"{name}.parquet"

    def _task_files(self, keys: Iterable[str]) -> dict[str, list[str]]:
        """Table -> its files."""
        found: dict[str, list[str]] = {}
        for key in sorted(keys):
            for entry in sorted(os.scandir(self.tasks / key), key=lambda one: one.name):
                if entry.name.endswith(".parquet"):
                    found.setdefault(entry.name.partition(".")[0], []).append(entry.path)
        return found

    def _link_files(self, done: Iterable[Planned]) -> None:
        """Give what tasks recorded and exported the names of the recordings."""
        shutil.rmtree(self.folder / FILES, ignore_errors=True)
        for one in done:
            for path in (self.tasks / one.key).iterdir():
                if path.suffix == ".parquet":
                    continue
                part = "" if one.begin_s is None else f"{one.begin_s:g}s."
                link = self.folder / FILES / one.recording / f"{part}{path.name}"
                link.parent.mkdir(parents=True, exist_ok=True)
                with suppress(FileExistsError):
                    link.symlink_to(os.path.relpath(path, link.parent))

    def write(self, name: str, text: str) -> None:
        """Replace a file."""
        path = self.folder / name
        new = path.with_name(f"{path.name}.{os.getpid()}.part")
        new.write_text(text)
        new.replace(path)


_PLANNED = declare(
    "number BIGINT -: position in the plan",
    "key VARCHAR -: key of the task",
    "recording VARCHAR -: name",
    "path VARCHAR -: file or folder",
    "size BIGINT B: size in bytes",
    "content VARCHAR -: digest",
    "begin_s DOUBLE s: beginning of the part",
    "until_s DOUBLE s: end of the part",
    "done BIGINT -: 1 if the task is done",
    "kind VARCHAR -: kind of failure",
    "reason VARCHAR -: reason for the failure",
    "attempts BIGINT -: number of attempts",
)


def _runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except OSError:
        return False
    return True


def _gathered(table: str, columns: Sequence[Column], files: Sequence[str]) -> str:
    """The query for all rows of a table, in the order of the plan."""
    if not files:
        empty = (f"NULL::{one.type} AS {one.name}" for one in columns_of(table))
        return f"SELECT {', '.join(empty)} WHERE false"
    chosen = ", ".join(f"one.{column.name}" for column in columns)
    paths = ", ".join(map(quoted, files))
    return (
        f"SELECT planned.recording, planned.key, {chosen} FROM read_parquet([{paths}],"
        " filename=true, file_row_number=true) AS one JOIN planned"
        " ON planned.key = parse_filename(parse_dirpath(one.filename))"
        " ORDER BY planned.number, one.filename, one.file_row_number"
    )


_METRES = 111_194.93  # of a degree of latitude, on a sphere of the Earth's mean radius

_TRAVELLED = f"""
    WITH places AS (
        SELECT recording, topic, 0 AS rank, t_ns, x, y, z FROM poses
        UNION ALL SELECT recording, topic, 1, t_ns,
            {_METRES} * longitude * cos(radians(latitude)), {_METRES} * latitude, altitude
        FROM fixes WHERE status >= 0
    ), chosen AS (
        SELECT recording, arg_min(topic, (rank, -messages, topic)) AS topic
        FROM (SELECT recording, topic, rank, count(*) AS messages FROM places GROUP BY ALL)
        GROUP BY recording
    ), sampled AS (
        SELECT recording, t_ns // 1000000000 AS second,
            arg_min(x, t_ns) AS x, arg_min(y, t_ns) AS y, arg_min(z, t_ns) AS z
        FROM places JOIN chosen USING (recording, topic) GROUP BY recording, second
    ), steps AS (
        SELECT recording, sqrt((x - lag(x) OVER one) ** 2 + (y - lag(y) OVER one) ** 2
            + (z - lag(z) OVER one) ** 2) AS step
        FROM sampled WINDOW one AS (PARTITION BY recording ORDER BY second)
    )
    SELECT recording, sum(step) AS distance_m FROM steps GROUP BY recording
"""

_LISTING = {
    "recordings": f"""
        SELECT recording, any_value(path) AS path, any_value(size) AS size,
            any_value(content) AS content, any_value(format) AS format,
            min(start_ns) AS start_ns, max(end_ns) AS end_ns,
            (max(end_ns) - min(start_ns)) / 1e9 AS duration_s, count(*) AS parts,
            sum(done)::BIGINT AS done, coalesce(sum(messages), 0)::BIGINT AS messages,
            any_value(distance_m) AS distance_m,
            coalesce(string_agg(DISTINCT nullif(lost, ''), '; '), '') AS lost, sum(cpu_s) AS cpu_s
        FROM planned LEFT JOIN segments USING (recording, key)
            LEFT JOIN ({_TRAVELLED}) USING (recording)
        GROUP BY recording ORDER BY min(number)
    """,
    "failures": """
        SELECT recording, path, key, begin_s, kind, reason, attempts FROM planned WHERE kind != ''
        UNION ALL
        SELECT segments.recording, path, key, segments.begin_s, 'node', segments.reason, 1
        FROM segments JOIN planned USING (recording, key) WHERE errors > 0
        ORDER BY recording, begin_s
    """,
}
"""Table -> the query that makes it of the others."""


def _readme(rows: Mapping[str, int]) -> str:
    """The columns of all tables, for people."""
    lines = [
        "# Results of `ros-visualise batch`",
        "",
        "These Parquet files are built from `tasks/`. If you delete that folder, the next run"
        ' starts from scratch. Query the files with `ros-visualise query FOLDER "SELECT ..."`, or'
        " open them with DuckDB, pandas or polars. Their metadata also holds the units, as"
        " `units`.",
    ]
    for table in (*LISTED, *TABLES):
        lines += ["", f"## {table}: {rows[table]} rows", "", "| column | type | unit | |"]
        lines += ["|---|---|---|---|"]
        lines += [f"| {c.name} | {c.type} | {c.unit} | {c.help} |" for c in columns_of(table)]
    return "\n".join(lines) + "\n"

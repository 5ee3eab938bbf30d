"""The tables of a batch: their columns, and how rows become Parquet files."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ros_visualise.core.errors import UsageError

if TYPE_CHECKING:
    import duckdb

Row = tuple[Any, ...]
SOURCES = ("streamer", "pictures", "player")
"""Names of the nodes that play what a batch is given."""
RECORDED = f"node IN {SOURCES}"
"""Condition for rows of what was recorded, in SQL."""

_SIZES = {"DOUBLE[36]": 36, "DOUBLE[9]": 9}


class Column(NamedTuple):
    """A column: its name, its type in SQL, its unit if any, and a few words about it."""

    name: str
    type: str
    unit: str
    help: str


def declare(*lines: str) -> tuple[Column, ...]:
    """Columns from lines as ``name TYPE unit: help``, where ``-`` is no unit."""
    found = []
    for line in lines:
        declared, _, help = line.partition(": ")
        name, kind, unit = declared.split()
        found.append(Column(name, kind, "" if unit == "-" else unit, help))
    return tuple(found)


_MADE = (
    "t_ns BIGINT ns: time stamp of the message",
    "node VARCHAR -: publisher",
    "topic VARCHAR -: topic",
)
_POSE = (
    "x DOUBLE m: position in the frame",
    "y DOUBLE m: position",
    "z DOUBLE m: position",
    "qx DOUBLE -: attitude, a quaternion",
    "qy DOUBLE -: attitude",
    "qz DOUBLE -: attitude",
    "qw DOUBLE -: attitude",
    "covariance DOUBLE[36] m2,m.rad,rad2: 6x6 matrix in row-major order (x, y, z, rotations);"
    " NULL if unknown",
)

TABLES: Mapping[str, tuple[Column, ...]] = {
    "segments": declare(
        "format VARCHAR -: format of the recording",
        "start_ns BIGINT ns: beginning of the recording",
        "end_ns BIGINT ns: end of the recording",
        "begin_s DOUBLE s: beginning of this part; NULL: the whole recording",
        "until_s DOUBLE s: end of this part; NULL: the whole recording",
        "messages BIGINT -: number of messages from the source in this part",
        "errors BIGINT -: number of errors in nodes",
        "reason VARCHAR -: text of the first error",
        "lost VARCHAR -: data that could not be read; empty if none was lost",
        "cpu_s DOUBLE s: processor time",
        "wall_s DOUBLE s: elapsed time",
        "peak_mb DOUBLE MB: peak memory",
        "host VARCHAR -: name of the machine",
        "version VARCHAR -: version of ros_visualise",
    ),
    "topics": declare(
        "topic VARCHAR -: topic",
        "type VARCHAR -: message type",
        "node VARCHAR -: publisher",
        "messages BIGINT -: number of messages",
        "first_ns BIGINT ns: stamp of the first message",
        "last_ns BIGINT ns: stamp of the last message",
        "max_gap_s DOUBLE s: longest time between two messages",
        "gap_ns BIGINT ns: time stamp of the last message before the longest gap",
    ),
    "nodes": declare(
        "node VARCHAR -: node",
        "inputs VARCHAR -: input topics, separated by commas",
        "processed BIGINT -: number of messages processed",
        "dropped BIGINT -: number of messages not processed or without a result",
        "errors BIGINT -: number of errors between messages, on a timer or at the end",
        "step_ms DOUBLE ms: median duration of a step",
        "p50_ms DOUBLE ms: median time from the source to the end of a step",
        "p99_ms DOUBLE ms: 99th percentile of the time from the source to the end of a step",
    ),
    "detections": declare(
        *_MADE,
        "frame VARCHAR -: frame of the camera",
        "label VARCHAR -: the most likely class",
        "id VARCHAR -: id of the object, constant over time",
        "score DOUBLE -: score of the class, 0 to 1",
        "left_px DOUBLE px: left edge of the bounding box",
        "top_px DOUBLE px: top edge of the bounding box",
        "width_px DOUBLE px: width of the bounding box",
        "height_px DOUBLE px: height of the bounding box",
        "u_px DOUBLE px: reference point",
        "v_px DOUBLE px: reference point",
        *_POSE,
    ),
    "poses": declare(
        *_MADE,
        "frame VARCHAR -: frame of the pose",
        "child VARCHAR -: child frame, if known",
        *_POSE,
        "vx DOUBLE m/s: velocity in the child frame (odometry only)",
        "vy DOUBLE m/s: velocity",
        "vz DOUBLE m/s: velocity",
    ),
    "fixes": declare(
        *_MADE,
        "latitude DOUBLE deg: latitude in WGS 84",
        "longitude DOUBLE deg: longitude in WGS 84",
        "altitude DOUBLE m: altitude above the ellipsoid",
        "status BIGINT -: status; below 0 means no fix",
        "covariance DOUBLE[9] m2: 3x3 matrix (east, north, up); NULL if unknown",
    ),
    "landmarks": declare(
        *_MADE,
        "frame VARCHAR -: frame of the map",
        "name VARCHAR -: name of the landmark",
        *_POSE,
    ),
    "image_stats": declare(
        *_MADE,
        "width BIGINT px: width",
        "height BIGINT px: height",
        "brightness DOUBLE -: mean luma, 0 to 1",
        "contrast DOUBLE -: standard deviation of the luma, 0 to 1",
        "sharpness DOUBLE -: variance of the Laplacian of the 8-bit luma; low means blurred",
        "dark DOUBLE -: fraction of pixels at 0",
        "bright DOUBLE -: fraction of pixels at the maximum",
    ),
    "fields": declare(
        *_MADE,
        "field VARCHAR -: path of the number in the message",
        "value DOUBLE -: number, in the unit that the ROS message defines",
    ),
}
"""Table -> the columns that a task writes; `recording` and `key` come before them."""

INDEXED = declare(
    "recording VARCHAR -: name of the recording: its path relative to the folder of recordings",
    "key VARCHAR -: key of the task: content, pipeline, parameters and version",
)
LISTED: Mapping[str, tuple[Column, ...]] = {
    "recordings": declare(
        "recording VARCHAR -: name",
        "path VARCHAR -: file or folder",
        "size BIGINT B: size in bytes",
        "content VARCHAR -: digest of its content",
        "format VARCHAR -: format of the recording",
        "start_ns BIGINT ns: beginning of the recording",
        "end_ns BIGINT ns: end of the recording",
        "duration_s DOUBLE s: duration",
        "parts BIGINT -: number of parts",
        "done BIGINT -: number of parts that are done",
        "messages BIGINT -: number of messages from the source",
        "distance_m DOUBLE m: path length from the topic with the most poses (or fixes, if no"
        " topic has poses), sampled at 1 Hz",
        "lost VARCHAR -: data that could not be read; empty if none was lost",
        "cpu_s DOUBLE s: processor time",
    ),
    "failures": declare(
        "recording VARCHAR -: name",
        "path VARCHAR -: file or folder",
        "key VARCHAR -: key of the task",
        "begin_s DOUBLE s: beginning of the part; NULL: the whole recording",
        "kind VARCHAR -: open, error, crash, timeout, memory or node (for node, rows are kept)",
        "reason VARCHAR -: reason for the failure, one line",
        "attempts BIGINT -: number of attempts",
    ),
}
"""Table -> columns of those that are made when all tasks are done."""


def columns_of(table: str) -> tuple[Column, ...]:
    """All columns of a finished table."""
    return LISTED.get(table) or (*INDEXED, *TABLES[table])


def connect(memory: int = 0, folder: Path | None = None) -> duckdb.DuckDBPyConnection:
    """DuckDB without a file, with one thread and a limit of memory.

    Raises:
        UsageError: it is not installed.
    """
    try:
        import duckdb
    except ImportError:
        raise UsageError(
            "batches need DuckDB; install it: pip install 'ros_visualise[batch]' (in a clone: pip"
            " install '.[batch]')"
        ) from None
    config: dict[str, Any] = {"autoinstall_known_extensions": False}  # from a server
    config |= {"threads": 1} if memory else {}
    if memory:
        config |= {"memory_limit": f"{memory >> 20}MiB"}
    if folder is not None:
        config |= {"temp_directory": str(folder)}
    return duckdb.connect(config=config)


def write_rows(
    connection: duckdb.DuckDBPyConnection, table: str, rows: Sequence[Row], path: Path
) -> None:
    """Write rows of a task's table."""
    query = registered(connection, "written", TABLES[table], rows)
    copy(connection, query, path, TABLES[table])
    connection.unregister("written")


def registered(
    connection: duckdb.DuckDBPyConnection,
    name: str,
    columns: Sequence[Column],
    rows: Sequence[Row],
) -> str:
    """Register rows, at least one, under a name; the query that gives them their types."""
    arrays: dict[str, Any] = {}
    chosen = []
    for column, values in zip(columns, zip(*rows, strict=True), strict=True):
        if column.type in _SIZES:
            chosen.append(_add_matrix(arrays, column, values))
        else:
            arrays[column.name] = _array(column.type, values)
            is_float = column.type == "DOUBLE"
            value = f"nullif({column.name}, 'nan'::DOUBLE)" if is_float else column.name
            chosen.append(f"{value}::{column.type} AS {column.name}")
    connection.register(name, arrays)
    return f"SELECT {', '.join(chosen)} FROM {name}"


def _add_matrix(arrays: dict[str, Any], column: Column, values: Sequence[Any]) -> str:
    """Add a column of lists, some of them None, as one of numbers for each place; its SQL."""
    size = _SIZES[column.type]
    numbers = np.full((len(values), size), np.nan)
    for row, value in enumerate(values):
        if value is not None:
            numbers[row] = np.ravel(value)
    names = [f"{column.name}_{place}" for place in range(size)]
    arrays |= {name: numbers[:, place].copy() for place, name in enumerate(names)}
    given = f"CASE WHEN NOT isnan({names[0]}) THEN list_value({', '.join(names)}) END"
    return f"{given}::{column.type} AS {column.name}"


def copy(
    connection: duckdb.DuckDBPyConnection, query: str, path: Path, columns: Iterable[Column]
) -> None:
    """Write the result of a query to a Parquet file, with the units of its columns."""
    columns = tuple(columns)
    units = json.dumps({one.name: one.unit for one in columns if one.unit})
    about = json.dumps({one.name: one.help for one in columns})
    connection.execute(
        f"COPY ({query}) TO {quoted(path)} (FORMAT parquet, COMPRESSION zstd,"
        f" KV_METADATA {{units: {quoted(units)}, columns: {quoted(about)}}})"
    )


def quoted(text: object) -> str:
    """A text in SQL."""
    return "'" + str(text).replace("'", "''") + "'"


def _array(kind: str, values: Sequence[Any]) -> np.ndarray[Any, Any]:
    if kind == "BIGINT":
        return np.array(values, np.int64)
    if kind == "DOUBLE":
        return np.array([np.nan if one is None else one for one in values], np.float64)
    found = np.empty(len(values), object)
    found[:] = [_utf8(one) for one in values]
    return found


def _utf8(text: str | None) -> str | None:
    """A text without what is no UTF-8, such as a letter of another encoding in a file's name."""
    return text and text.encode(errors="backslashreplace").decode()

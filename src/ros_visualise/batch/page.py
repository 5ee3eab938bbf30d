"""A page of a batch's results: tables, histograms, and moments that a click opens."""

from __future__ import annotations

import asyncio
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import closing, suppress
from functools import partial
from html import escape
from typing import IO, TYPE_CHECKING, Any
from urllib.parse import urlencode

import numpy as np

from ros_visualise.batch.results import Results
from ros_visualise.batch.tables import RECORDED
from ros_visualise.batch.work import Work
from ros_visualise.core import supervision
from ros_visualise.plotting.columns import plot_columns
from ros_visualise.sources.opening import is_recording
from ros_visualise.ui.server.access import AccessRules
from ros_visualise.ui.server.answers import READ_ONLY, Answer, BrowserQuery, Refusal
from ros_visualise.ui.server.door import listen
from ros_visualise.ui.server.gate import Gate, Receive, Scope, Send, Visit, send_answer
from ros_visualise.ui.server.host import PageHost

if TYPE_CHECKING:
    import duckdb

_OPENED = "open http"
_MOST_ROWS = 2000
_BINS = 24
_STYLE = """body { font: 14px/1.5 sans-serif; margin: 1.5em; color-scheme: light dark; }
table { border-collapse: collapse; } td, th { padding: .15em .7em; text-align: left; }
tr:nth-child(even) { background: #8882; } svg { background: white; zoom: .7; }
figure { display: inline-block; margin: 0 1em 1em 0; }"""

_IMAGES = f"SELECT * FROM image_stats WHERE {RECORDED}"
_AT = "(t_ns - start_ns) / 1e9 AS at_s"
_MOMENTS = {
    "The most blurred images": f"SELECT recording, t_ns, {_AT}, topic, sharpness"
    f" FROM ({_IMAGES}) JOIN recordings USING (recording)"
    " QUALIFY row_number() OVER (PARTITION BY recording ORDER BY sharpness, t_ns) <= 3"
    " ORDER BY sharpness LIMIT 20",
    "The first detection of each object": f"SELECT recording, t_ns, {_AT}, label, times FROM"
    " (SELECT recording, min(t_ns) AS t_ns, label, count(*) AS times FROM detections GROUP BY ALL)"
    " JOIN recordings USING (recording) ORDER BY ALL LIMIT 200",
    "The longest gaps in topics": "SELECT recording, gap_ns AS t_ns,"
    " (gap_ns - start_ns) / 1e9 AS at_s, topic, max_gap_s, topics.messages"
    " FROM topics JOIN recordings USING (recording) WHERE topics.messages > 1 AND"
    f" {RECORDED}"
    " ORDER BY max_gap_s DESC LIMIT 20",
}
"""Heading -> a query whose rows lead to a moment of a recording."""

_TABLES = {
    "Recordings": "SELECT recording, start_ns AS t_ns, format, duration_s, distance_m, messages,"
    " done || ' of ' || parts AS parts, lost, cpu_s FROM recordings",
    "Failures": "SELECT recording, NULL AS t_ns, kind, reason, attempts FROM failures",
}
_HISTOGRAMS = {
    "duration of each recording, s": "SELECT duration_s FROM recordings",
    "brightness of each image": f"SELECT brightness FROM ({_IMAGES})",
    "sharpness of each image": f"SELECT sharpness FROM ({_IMAGES})",
    "score of each detection": "SELECT score FROM detections",
    "longest gap in each topic, s": "SELECT max_gap_s FROM topics WHERE messages > 1",
}


class ResultsPage:
    """Serves the page of a batch's results from the start; close it.

    Raises:
        OpenError: no results there, or the port is in use.
    """

    def __init__(self, results: Results, host: str, port: int, rules: AccessRules) -> None:
        results.open_tables().close()
        self._results = results
        self._work = Work.restored(results.read_plan()[0]["work"])
        self._viewer: subprocess.Popen[str] | None = None
        self._opening = threading.Lock()
        self._host = PageHost(Gate(self._serve, rules), listen(host, port, "--{} {}"))

    def close(self) -> None:
        """Stop it, and the recording that was opened."""
        self._host.close()
        self._end_viewer()

    async def _serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        visit: Visit = scope["state"]["visit"]
        query = BrowserQuery(scope["query_string"].decode("latin-1"))
        path = scope["path"].removeprefix(scope["root_path"])
        if scope["type"] != "http" or path not in ("", "/", "/open"):
            raise Refusal("no such page", 404)
        if path == "/open":
            if visit.is_viewer or visit.is_foreign:
                raise Refusal(READ_ONLY, 403)
            name, t_ns = query.text("recording"), query.whole("t_ns")
            address = await asyncio.to_thread(self._open, name, t_ns)
            answer = Answer(b"", "text/plain", 303, {"Location": address})
        else:
            body = await asyncio.to_thread(self._page, scope["root_path"])
            answer = Answer(body, "text/html; charset=utf-8")
        visit.hold(len(answer.body))
        await send_answer(scope, send, answer)

    def _page(self, root: str) -> bytes:
        title = f"Batch {self._results.folder}"
        parts = [f"<!DOCTYPE html><title>{escape(title)}</title><style>{_STYLE}</style>"]
        parts.append(f"<h1>{escape(title)}</h1>")
        with closing(self._results.open_tables()) as sql:
            for heading, query in {**_TABLES, **_MOMENTS}.items():
                parts += _table(sql, heading, query, root)
            parts.append("<h2>Histograms</h2>")
            for heading, query in _HISTOGRAMS.items():
                parts += _histogram(sql, heading, query)
        return "\n".join(parts).encode()

    def _open(self, name: str, t_ns: int | None) -> str:
        """Open a recording in a program of its own; the address of its page."""
        with closing(self._results.open_tables()) as sql:
            row = sql.execute(
                "SELECT path, start_ns FROM recordings WHERE recording = ?", [name]
            ).fetchone()
        if row is None:
            raise Refusal("no such recording", 404)
        path, start_ns = row
        start_s = max(0.0, ((t_ns or 0) - (start_ns or 0)) / 1e9)
        with self._opening:
            self._end_viewer()
            command = [*_viewing(self._work, path, start_s)]
            self._viewer = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
            assert self._viewer.stderr is not None
            said = ""
            for line in self._viewer.stderr:
                said = line.strip()
                if said.startswith(_OPENED):
                    supervision.start("viewer", partial(_drain, self._viewer.stderr))
                    return said.split()[1]
            self._viewer.stderr.close()
        raise Refusal(f"cannot be opened: {said}", 500)

    def _end_viewer(self) -> None:
        if self._viewer is not None:
            self._viewer.terminate()
            with suppress(subprocess.TimeoutExpired):
                self._viewer.wait(5)


def _drain(said: IO[str]) -> None:
    with said:
        for _ in said:
            pass


def _viewing(work: Work, path: str, start_s: float) -> Iterator[str]:
    """The command that shows a recording with the nodes of the batch."""
    yield from (sys.executable, "-m", "ros_visualise")
    yield from ("bag" if is_recording(path) else "video", path, "--start", f"{start_s:.3f}")
    yield from ("--no-open", "--port", str(_free_port()))
    if work.pipeline == "landmarks":
        yield "--landmarks"
    if work.pipeline == "navigate":
        yield "--navigate"
    for name, values in (("--node", work.node), ("--set", work.set)):
        for value in values:
            yield from (name, value)
    for name, value in (("--params", work.params), ("--preset", work.preset)):
        yield from (name, value) if value else ()
    if is_recording(path):
        for name, topic in (("--image", work.image), ("--odom", work.odom)):
            yield from (name, topic) if topic is not None else ()
        if work.topics:
            yield from ("--topics", *work.topics)


def _free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def _table(sql: duckdb.DuckDBPyConnection, heading: str, query: str, root: str) -> Iterator[str]:
    """A table whose first column links to the moment in the second one."""
    answer = sql.execute(query)
    names = [one[0] for one in answer.description or ()]
    rows = answer.fetchmany(_MOST_ROWS + 1)
    if not rows:
        return
    yield f"<h2>{escape(heading)}</h2><table><tr><th>{'<th>'.join(['recording', *names[2:]])}"
    for name, t_ns, *cells in rows[:_MOST_ROWS]:
        link = urlencode({"recording": name, **({} if t_ns is None else {"t_ns": t_ns})})
        texts = "<td>".join(escape(_text(one)) for one in cells)
        yield f'<tr><td><a href="{root}/open?{link}">{escape(name)}</a><td>{texts}'
    yield "</table>"
    if len(rows) > _MOST_ROWS:
        yield f"<p>The first {_MOST_ROWS}; <code>ros-visualise query</code> lists all.</p>"


def _text(cell: Any) -> str:
    if cell is None:
        return ""
    return f"{cell:.4g}" if isinstance(cell, float) else str(cell)


def _histogram(sql: duckdb.DuckDBPyConnection, heading: str, query: str) -> Sequence[str]:
    (values,) = sql.execute(query).fetchnumpy().values()
    numbers = np.ma.filled(values.astype(np.float64), np.nan)
    numbers = numbers[np.isfinite(numbers)]
    if not len(numbers):
        return []
    counts, edges = np.histogram(numbers, _BINS)
    steps = {heading: np.repeat(edges, 2)[1:-1], "count": np.repeat(counts, 2).astype(np.float64)}
    picture = plot_columns(steps).svg().decode()
    return [f"<figure><figcaption>{escape(heading)}</figcaption>{picture}</figure>"]

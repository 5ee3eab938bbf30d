"""Curves for browsers: of each what its view needs, as numbers in binary, after each change.

A browser sends ``{"number": N, "views": [VIEW], "from": S, "to": S, "last": S, "columns": N}``:
the views of a panel, their common part of the time, null for the whole, or its last seconds, and
their width in pixels. A view is ``{"curve": NAME}``, ``{"x": NAME, "y": NAME}``, or a name as
``spectrum`` or ``histogram``, or a topic as ``intervals`` or ``rates``. Each is answered by a
message: the length of a header (uint32), the header in JSON, and rows of numbers (float64, NaN for
a gap). ``{"fields": TOPIC}``, ``{"at": S, "curves": [NAME]}`` and ``{"csv": [NAME]}``, with
``from`` and ``to``, are answered in JSON.
"""

from __future__ import annotations

import asyncio
import json
import math
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.live import analysis
from ros_visualise.ui.live.curve_set import BadCurve, Curve, CurveSet
from ros_visualise.ui.live.derived import Sampled
from ros_visualise.ui.live.exchange import exchange, read_object
from ros_visualise.ui.live.units import unit_of
from ros_visualise.ui.periodic import PeriodicThread
from ros_visualise.ui.server.gate import Receive, Scope, Send
from ros_visualise.ui.server.pool import Pool

_MOST_VIEWS, _MOST_QUESTIONS = 64, 64
_COLUMNS = 16, 4096
_PERIOD_S = 0.1
_FARTHEST_S = 1e12
_ROWS = 4000  # of a table, in one message
_THREADS = 2
_OF_TOPICS = ("intervals", "rates")
_KINDS = ("curve", "spectrum", "histogram", *_OF_TOPICS)
_WAIT_S = 0.1


class PlotHub:
    """Serves the plots of all browsers from one set of curves."""

    path = "/live/plots"

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._pool = Pool("plots", _THREADS)
        self._browsers: set[_PlotReader] = set()
        self._followed: _Followed | None = None

    def show(self, runtime: Runtime | None) -> None:
        """Plot the topics of this runtime from now on, or none; from any thread."""
        if self._followed is not None:
            self._followed.close()
        self._followed = None if runtime is None else _Followed(runtime, self._wake)
        self._wake()

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one browser until it leaves."""
        browser = _PlotReader(lambda: self._followed, self._pool, send)
        self._browsers.add(browser)
        try:
            await exchange(receive, send, browser.send_all(), browser.hear)
        finally:
            self._browsers.discard(browser)

    def close(self) -> None:
        """End all threads."""
        self.show(None)
        self._pool.close()

    def _wake(self) -> None:
        self._loop.call_soon_threadsafe(self._wake_all)

    def _wake_all(self) -> None:
        for browser in self._browsers:
            browser.news.set()


class _Followed:
    """The curves of a graph, and the thread that lets them grow."""

    def __init__(self, runtime: Runtime, wake: Callable[[], None]) -> None:
        self.runtime = runtime
        self.curves = CurveSet(runtime)
        self._wake, self._seen = wake, object()
        self._thread = PeriodicThread(
            "live curves", self._grow, self.curves.close, _PERIOD_S, self._unthrottled
        )
        self._thread.start()

    def close(self) -> None:
        self._thread.close(0)

    def _grow(self) -> None:
        self.curves.rest()
        seen = self.curves.version, self.runtime.graph
        if seen != self._seen:
            self._seen = seen
            self._wake()

    def _unthrottled(self) -> bool:
        playback = self.runtime.playback
        return playback is not None and playback.state.rate == 0


class _PlotReader:
    """One browser: its views, and what it asks."""

    def __init__(self, followed: Callable[[], _Followed | None], pool: Pool, send: Send) -> None:
        self._followed, self._pool, self._send = followed, pool, send
        self.news = asyncio.Event()
        self.news.set()
        self._request: dict[str, Any] = {}
        self._questions: list[dict[str, Any]] = []
        self._sent: dict[int, object] = {}
        self._topics: object = None

    def hear(self, text: str) -> None:
        """Note a message; anything else than those that our pages send is ignored."""
        message = read_object(text)
        if message is None:
            return
        if isinstance(message.get("views"), list):
            self._request, self._sent = message, {}
        elif len(self._questions) < _MOST_QUESTIONS:
            self._questions.append(message)
        self.news.set()

    async def send_all(self) -> None:
        """Answer what was asked, and send what has changed."""
        while True:
            await self.news.wait()
            self.news.clear()
            if (followed := self._followed()) is None:
                continue
            if followed.runtime.graph is not self._topics:
                self._topics = followed.runtime.graph
                topics = {name: one.ros.name for name, one in followed.runtime.graph.topics.items()}
                await self._send_json({"topics": topics})
            while self._questions:
                await self._answer(followed, self._questions.pop(0))
            start_s = asyncio.get_running_loop().time()
            request, sent = self._request, self._sent
            for packet in await self._pool.do(partial(_packets, followed, request, sent)):
                await self._send({"type": "websocket.send", "bytes": packet})
            if request is self._request:  # leave processor time for others
                spent_s = asyncio.get_running_loop().time() - start_s
                await asyncio.sleep(0 if self.news.is_set() else spent_s)

    async def _answer(self, followed: _Followed, question: Mapping[str, Any]) -> None:
        if isinstance(topic := question.get("fields"), str):
            await self._send_json(await self._pool.do(partial(_fields, followed.curves, topic)))
        elif (names := _names(question.get("csv"))) is not None:
            while await self._pool.do(partial(_is_loading, followed.curves, names)):
                await asyncio.sleep(_WAIT_S)
            pieces = _table(followed.curves, names, *_span(question))
            while piece := await self._pool.do(partial(next, pieces, "")):
                await self._send_json({"csv": piece})
            await self._send_json({"csv": ""})
        elif (names := _names(question.get("curves"))) is not None:
            at_s = _number(question.get("at"))
            if at_s is not None:
                values = await self._pool.do(partial(_values, followed.curves, names, at_s))
                await self._send_json({"at": at_s, "values": values})

    async def _send_json(self, message: Mapping[str, Any]) -> None:
        text = json.dumps(message, allow_nan=False)
        await self._send({"type": "websocket.send", "text": text})


def _packets(
    followed: _Followed, request: Mapping[str, Any], sent: dict[int, object]
) -> list[bytes]:
    """The views of a request that have changed since they were sent."""
    views = [_View(view) for view in request["views"][:_MOST_VIEWS]] if request else []
    followed.curves.begin(name for view in views for name in view.names)
    start_s, end_s = _span(request)
    if (last_s := _number(request.get("last"))) is not None:
        start_s = followed.curves.live.now_s - abs(last_s)
    columns = request.get("columns")
    columns = min(max(columns if type(columns) is int else 0, _COLUMNS[0]), _COLUMNS[1])
    packets = []
    for number, view in enumerate(views):
        header: dict[str, Any] = {"number": _number(request.get("number")), "view": number}
        header["origin"] = followed.curves.live.origin_s
        rows = np.empty((0, 2))
        try:
            curves = [followed.curves.curve(name) for name in view.names]
            state: object = [curve.state for curve in curves]
            if sent.get(number) == state:
                continue
            rows, more = view.rows(curves, start_s, end_s, columns)
            header |= more | _describe(curves)
        except BadCurve as bad:
            state = header["error"] = str(bad)
            if sent.get(number) == state:
                continue
        sent[number] = state
        packets.append(packet(header, rows))
    return packets


class _View:
    """A view that a browser asked for; one that is malformed has no curve of its name."""

    def __init__(self, asked: Any) -> None:
        self._kind, self.names = "curve", [""]
        asked = asked if isinstance(asked, dict) else {}
        if isinstance(asked.get("x"), str) and isinstance(asked.get("y"), str):
            self._kind, self.names = "pairs", [asked["x"], asked["y"]]
            return
        for kind in _KINDS:
            if isinstance(name := asked.get(kind), str):
                self._kind, self.names = kind, [f"{name}:" if kind in _OF_TOPICS else name]

    def rows(
        self, curves: Sequence[Curve], start_s: float, end_s: float, columns: int
    ) -> tuple[Floats, dict[str, Any]]:
        """The numbers, and what the header says of them."""
        one = curves[0]
        if self._kind == "curve":
            return np.column_stack(one.store.between(one.path, start_s, end_s, columns)), {}
        parts = [curve.part(start_s, end_s) for curve in curves]
        if self._kind == "pairs":
            units = {"units": [curve.unit for curve in curves]}
            return analysis.pairs(parts[0], parts[1], 4 * columns), units
        if self._kind == "spectrum":
            return analysis.spectrum(parts[0], columns), {}
        if self._kind == "rates":
            return analysis.rates(parts[0], columns), {}
        if self._kind == "intervals":
            rows, summary = analysis.intervals(parts[0])
        else:
            rows, summary = analysis.histogram(parts[0].values)
        return rows, {"summary": summary}


def packet(header: Mapping[str, Any], rows: Floats) -> bytes:
    """A message: the header, filled up so that the numbers begin at a multiple of 8 bytes."""
    text = json.dumps({**header, "width": rows.shape[1]}, allow_nan=False).encode()
    text += b" " * (-(4 + len(text)) % 8)
    rows = np.where(np.isinf(rows), np.nan, rows).astype("<f8")
    return struct.pack("<I", len(text)) + text + rows.tobytes()


def _describe(curves: Sequence[Curve]) -> dict[str, Any]:
    shares = [curve.share for curve in curves if curve.share is not None]
    spans_s = [span for curve in curves if (span := curve.store.span_s) is not None]
    return {
        "share": min(shares, default=None),
        "error": next((curve.error for curve in curves if curve.error), ""),
        "unit": curves[-1].unit,
        "span": [min(s for s, _ in spans_s), max(e for _, e in spans_s)] if spans_s else None,
    }


def _fields(curves: CurveSet, topic: str) -> Mapping[str, Any]:
    try:
        found = curves.fields(topic)
    except (BadCurve, ValueError) as bad:
        return {"fields": topic, "error": str(bad)}
    return {"fields": topic, "paths": found, "units": [unit_of(path) for path in found]}


def _values(curves: CurveSet, names: Sequence[str], at_s: float) -> list[float | None]:
    curves.begin(names)
    known = _known(curves, names)
    values = {name: curve.store.at(curve.path, at_s) for name, curve in known.items()}
    found = [values.get(name, math.nan) for name in names]
    return [value if math.isfinite(value) else None for value in found]


def _is_loading(curves: CurveSet, names: Sequence[str]) -> bool:
    """True while a recording is being read for these curves."""
    curves.begin(names)
    shares = [one.share for one in _known(curves, names).values()]
    return any(share is not None and share < 1 for share in shares)


def _known(curves: CurveSet, names: Sequence[str]) -> dict[str, Curve]:
    """Those curves that can be plotted."""
    found = {}
    for name in names:
        with suppress(BadCurve):
            found[name] = curves.curve(name)
    return found


def _table(curves: CurveSet, names: Sequence[str], start_s: float, end_s: float) -> Iterator[str]:
    """Curves as CSV: a row for each stamp, with empty cells where a curve has no sample."""
    known = _known(curves, names)
    quoted = ['"' + name.replace('"', '""') + '"' for name in known]
    yield ",".join(["time", "stamp", *quoted]) + "\n"
    columns = [curve.part(start_s, end_s) for curve in known.values()]
    times_s = np.unique(np.concatenate([np.empty(0), *(one.times_s for one in columns)]))
    for first in range(0, len(times_s), _ROWS):
        piece_s = times_s[first : first + _ROWS]
        stamps_ns = [curves.live.stamp_ns(time_s) for time_s in piece_s.tolist()]
        cells = [
            [f"{time_s:.9f}" for time_s in piece_s.tolist()],
            [f"{stamp_ns // 10**9}.{stamp_ns % 10**9:09d}" for stamp_ns in stamps_ns],
            *(_cells(column, piece_s) for column in columns),
        ]
        yield "".join(",".join(row) + "\n" for row in zip(*cells, strict=True))


def _cells(column: Sampled, times_s: Floats) -> list[str]:
    """The values of a curve at some times, as text; empty without one."""
    at = np.searchsorted(column.times_s, times_s)
    at[at == len(column.times_s)] = 0
    if not len(column.times_s):
        return [""] * len(times_s)
    there = column.times_s[at] == times_s
    values = column.values[at].tolist()
    return [repr(value) if is_there else "" for value, is_there in zip(values, there, strict=True)]


def _span(message: Mapping[str, Any]) -> tuple[float, float]:
    start_s, end_s = _number(message.get("from")), _number(message.get("to"))
    return -math.inf if start_s is None else start_s, math.inf if end_s is None else end_s


def _number(value: Any) -> float | None:
    """A number of a browser, None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return value if abs(value) <= _FARTHEST_S else None


def _names(value: Any) -> list[str] | None:
    """Names of curves from a browser, None for anything else."""
    if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
        return None
    return value[:_MOST_VIEWS]

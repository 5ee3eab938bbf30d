"""Numeric fields of topics over the time of playback, and curves computed from them.

The curves of a recorded topic are whole from the start; those of other topics grow from the first
request on, and go on for ten minutes after the last. The samples of all take at most 1 GiB: beyond,
the curves that were not requested for the longest time are forgotten.
"""

from __future__ import annotations

import threading
from collections.abc import Collection
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.runtime.base import Runtime
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.recordings.series import SeriesRecording
from ros_visualise.ui.live.curves import SampleStore
from ros_visualise.ui.live.derived import BadExpression, Expression, Sampled
from ros_visualise.ui.live.sampling import LiveCurves, RecordedCurves
from ros_visualise.ui.live.taps import Taps
from ros_visualise.ui.live.trees import fields_of
from ros_visualise.ui.server.answers import Answer, BrowserQuery, Refusal, as_json

Name = tuple[str, str]
"""A topic and the path of a field."""
_EXPRESSION = "="
"""First character of a curve that is computed from others."""
_VALUE = "value"
_MAX_CURVES = 24  # of one request
_MAX_BYTES = 1 << 30
_MAX_DERIVED = 50
_COLUMNS = 750  # of pixels
_WAIT_S = 0.5


class Curves:
    """Answers requests for curves.

    Args:
        runtime: the runtime whose topics are plotted.
        max_bytes: limit of all samples in memory.
    """

    def __init__(self, runtime: Runtime, max_bytes: int = _MAX_BYTES) -> None:
        self._most_bytes = max_bytes
        self._runtime = runtime
        self._newest = Taps(runtime, 1)
        self._live = LiveCurves(runtime)
        self._stores: dict[Name, SampleStore] = {}  # the last requested last
        self._derived: dict[str, tuple[object, SampleStore]] = {}
        self._lock, self._deriving = threading.Lock(), threading.Lock()
        source = runtime.graph.source
        self._recorded: dict[str, str] = {}
        self._reader: RecordedCurves | None = None
        if source is not None and source.type.recording is not None:
            self._recorded = _inverse(source.outputs)
            played = list(self._recorded.values())
            self._reader = RecordedCurves(partial(open_recording, source.type.recording), played)
        elif source is not None and source.type.series:
            series = source.type.series
            measured = {one.topic for one in series}
            self._recorded = {t: p for t, p in _inverse(source.outputs).items() if p in measured}
            self._reader = RecordedCurves(lambda: SeriesRecording(Path(), "film", 0, series), None)

    @property
    def topics(self) -> list[str]:
        """Topics whose messages may hold numeric fields."""
        topics: dict[str, Any] = {n: one.type for n, one in self._runtime.graph.topics.items()}
        return [name for name, kind in topics.items() if kind.plotted]

    def fields(self, query: BrowserQuery) -> Answer:
        """Paths of a topic's numeric fields, by its newest or its first recorded message.

        Raises:
            Refusal: no such topic, or no message yet.
        """
        topic = query.text("topic")
        if refusal := self._refusal(topic):
            raise Refusal(refusal, 404)
        message = self._newest.newest(topic, _WAIT_S)
        if message is None and self._reader is not None and not self._is_live(topic):
            message = self._reader.first(self._recorded[topic], _WAIT_S)
        if message is None:
            raise Refusal("no message yet", 404)
        return as_json({"fields": list(fields_of(message))})

    def curves(self, query: BrowserQuery) -> Answer:
        """Curves of fields such as ``/odom:pose.pose.position.x``, from one second to another.

        A name that begins with ``=`` is an expression; see `ros_visualise.ui.live.derived`. A curve
        that cannot be plotted is empty, with the reason.

        Raises:
            Refusal: malformed request.
        """
        texts = query.texts("field")[:_MAX_CURVES]
        start_s, end_s = query.seconds("from"), query.seconds("to")
        wanted = [_Wanted(text) for text in texts]
        names = dict.fromkeys(name for one in wanted for name in one.names)
        self._begin_new([name for name in names if not self._refusal(name[0])], texts)
        self._live.take()
        found = [self._describe(one, start_s, end_s) for one in wanted]
        return as_json({"curves": found, **self._position()})

    def rest(self, all_of_them: bool = False) -> None:
        """Append what has arrived; unsubscribe from topics that were not requested lately."""
        self._newest.rest(all_of_them)
        self._live.take()
        self._live.rest(all_of_them)
        with self._lock:
            self._forget_oldest(set())

    def close(self) -> None:
        """Unsubscribe from all, and close the recording."""
        self.rest(all_of_them=True)
        if self._reader is not None:
            self._reader.close()

    def _refusal(self, topic: str) -> str:
        """Why a topic has no curves; empty if it has some."""
        if topic not in self._runtime.graph.topics:
            return f"no such topic: {topic}"
        return "" if topic in self.topics else f"{topic} has no numeric fields"

    def _begin_new(self, names: list[Name], shown: Collection[str]) -> None:
        """Begin with curves that are new, all of one topic together."""
        with self._lock:
            new = sorted({name for name in names if name not in self._stores})
            for topic, group in groupby(new, key=lambda name: name[0]):
                self._begin(topic, [path for _, path in group])
            for name in names:
                self._stores[name] = self._stores.pop(name)
            self._forget_oldest(set(names), shown)
        if any(self._is_live(topic) for topic, _ in names):
            self._live.keep()

    def _begin(self, topic: str, paths: list[str]) -> None:
        is_live = self._is_live(topic)
        store = SampleStore(paths, None if is_live else 0.0)
        self._stores.update({(topic, path): store for path in paths})
        if is_live:
            self._live.add(topic, store)
            return
        assert self._reader is not None
        self._reader.fill(self._recorded[topic], store)

    def _forget_oldest(self, used: set[Name], shown: Collection[str] = ()) -> None:
        """Forget what is neither used nor shown, until all fits into memory."""
        for text in list(self._derived):
            if self._nbytes <= self._most_bytes:
                return
            if text not in shown:
                self._derived.pop(text, None)
        kept = {id(self._stores[name]) for name in used}
        for name, store in list(self._stores.items()):
            if self._nbytes <= self._most_bytes:
                return
            if id(store) not in kept and name in self._stores:
                self._live.forget(name[0], store)
                self._stores = {n: one for n, one in self._stores.items() if one is not store}

    @property
    def _nbytes(self) -> int:
        """Size of all samples in memory, bytes."""
        derived = [store for _, store in list(self._derived.values())]
        every = {id(one): one.nbytes for one in (*list(self._stores.values()), *derived)}
        return sum(every.values())

    def _is_live(self, topic: str) -> bool:
        return topic not in self._recorded

    def _describe(self, wanted: _Wanted, start_s: float, end_s: float) -> dict[str, Any]:
        stores = [self._stores[name] for name in wanted.names if name in self._stores]
        shares = [store.share for store in stores if store.share is not None]  # before the samples
        error = wanted.error or next(
            (reason for topic, _ in wanted.names if (reason := self._refusal(topic))), ""
        )
        times_s, values = np.empty(0), np.empty(0)
        try:
            if not error and len(stores) == len(wanted.names):
                store, path = self._read(wanted, stores)
                times_s, values = store.between(path, start_s, end_s, _COLUMNS)
        except BadExpression as bad:
            error = str(bad)
        return {
            "name": wanted.text,
            "times": _numbers(times_s),
            "values": _numbers(values),
            "share": min(shares, default=1.0 if error else None),
            "error": error or next((store.error for store in stores if store.error), ""),
        }

    def _read(self, wanted: _Wanted, stores: list[SampleStore]) -> tuple[SampleStore, str]:
        """The store of a curve, and its path there; expressions are computed anew after changes."""
        if wanted.expression is None:
            return stores[0], wanted.names[0][1]
        with self._deriving:
            return self._compute(wanted.text, wanted.expression, wanted.names, stores), _VALUE

    def _compute(
        self, text: str, expression: Expression, names: list[Name], stores: list[SampleStore]
    ) -> SampleStore:
        state = [(id(store), store.version) for store in stores]
        before, store = self._derived.get(text, (None, None))
        if store is None or before != state:
            if self._nbytes > self._most_bytes:
                raise BadExpression("the curves take too much memory; remove some")
            sources = {
                ":".join(name): partial(_sampled, one, name[1])
                for name, one in zip(names, stores, strict=True)
            }
            found = expression.compute(lambda name: sources[name]())
            store = SampleStore([_VALUE])
            store.add(found.times_s, found.values[:, None])
            self._derived.pop(text, None)
            self._derived[text] = state, store
            for name in list(self._derived)[:-_MAX_DERIVED]:
                del self._derived[name]
        return store

    def _position(self) -> dict[str, Any]:
        """Position and length of playback."""
        playback = self._runtime.playback
        if playback is None or not self._live.is_played:
            playing = playback is None or playback.state.playing
            return {"position": self._live.now_s, "length": None, "playing": playing}
        state = playback.state
        return {
            "position": state.position_s,
            "length": state.duration_s,
            "playing": state.playing,
        }


class _Wanted:
    """A requested curve: a field, or an expression over several.

    Raises:
        Refusal: it is neither.
    """

    def __init__(self, text: str) -> None:
        self.text, self.error = text, ""
        self.expression: Expression | None = None
        self.names: list[Name] = []
        if not text.startswith(_EXPRESSION):
            self.names = [_parse(text)]
            return
        try:
            self.expression = Expression(text.removeprefix(_EXPRESSION))
            self.names = [_parse(name) for name in self.expression.names]
        except (BadExpression, Refusal) as bad:
            self.error, self.names = str(bad), []


def _sampled(store: SampleStore, path: str) -> Sampled:
    return Sampled(*store.whole(path))


def _parse(text: str) -> Name:
    topic, _, path = text.rpartition(":")
    if not topic or not path:
        raise Refusal("give fields as /odom:pose.pose.position.x")
    return topic, path


def _inverse(outputs: Any) -> dict[str, str]:
    return {topic: port for port, topic in outputs.items()}


def _numbers(numbers: Floats) -> list[float | None]:
    """Numbers for JSON, which lacks NaN and infinities: those are null."""
    plain: list[float | None] = numbers.tolist()
    for index in np.flatnonzero(~np.isfinite(numbers)).tolist():
        plain[index] = None
    return plain

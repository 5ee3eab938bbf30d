"""Numbers of topics over the time of playback by their names, and curves computed from them.

A name is a topic and a path, as ``/odom:pose.pose.position.x``, or ``=`` and an expression; see
`ros_visualise.ui.live.derived`. The curves of a recorded topic are whole from the start; those of
other topics grow from the first request on, and go on for ten minutes after the last. The samples
of all take at most 1 GiB: beyond, those not requested for the longest time are forgotten.
"""

from __future__ import annotations

import threading
from collections.abc import Collection, Iterable
from functools import lru_cache, partial
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

from ros_visualise.runtime.base import Runtime
from ros_visualise.sources.recordings.series import SeriesRecording
from ros_visualise.ui.live.curves import SampleStore
from ros_visualise.ui.live.derived import BadExpression, Expression, Sampled
from ros_visualise.ui.live.sampling import LiveCurves, RecordedCurves
from ros_visualise.ui.live.taps import Taps
from ros_visualise.ui.live.trees import fields_of
from ros_visualise.ui.live.units import unit_of

Name = tuple[str, str]
"""A topic and the path of a field."""
_EXPRESSION = "="
_VALUE = "value"
_MAX_BYTES = 1 << 30
_MAX_DERIVED = 50
_WAIT_S = 0.5


class BadCurve(ValueError):
    """A curve that cannot be plotted; the text is for the person who asked for it."""


class Curve(NamedTuple):
    """A curve as it is now.

    Attributes:
        store, path: its samples, and its place there.
        share: share that is loaded, 0 to 1; None: it grows as messages arrive.
        error: why it ends early; empty if it does not.
        unit: unit of its values; empty if unknown.
    """

    store: SampleStore
    path: str
    share: float | None
    error: str
    unit: str

    @property
    def state(self) -> object:
        """Another value after each change."""
        return self.store, self.store.version, self.share, self.error

    def samples(self) -> Sampled:
        """All of them."""
        return Sampled(*self.store.whole(self.path))

    def part(self, start_s: float, end_s: float) -> Sampled:
        """The samples from one time to another."""
        times_s, values = self.store.whole(self.path)
        first, last = times_s.searchsorted(start_s), times_s.searchsorted(end_s, "right")
        return Sampled(times_s[first:last], values[first:last])


class CurveSet:
    """The curves of a graph.

    Args:
        runtime: its topics are plotted.
        max_bytes: limit of all samples in memory.
    """

    def __init__(self, runtime: Runtime, max_bytes: int = _MAX_BYTES) -> None:
        self._most_bytes = max_bytes
        self._runtime = runtime
        self._newest = Taps(runtime)
        self.live = LiveCurves(runtime)
        self._stores: dict[Name, SampleStore] = {}  # the last requested last
        self._derived: dict[str, tuple[object, SampleStore]] = {}
        self._lock, self._deriving = threading.Lock(), threading.Lock()
        source = runtime.graph.source
        self._recorded: dict[str, str] = {}
        self._reader: RecordedCurves | None = None
        self._line = None if runtime.playback is None else runtime.playback.recorded
        if source is not None and source.type.recording is not None and self._line is not None:
            self._recorded = _inverse(source.outputs)
            self._reader = self._recorded_curves()
        elif source is not None and source.type.series:
            series = source.type.series
            measured = {one.topic for one in series}
            self._recorded = {t: p for t, p in _inverse(source.outputs).items() if p in measured}
            self._reader = RecordedCurves(lambda: SeriesRecording(Path(), "film", 0, series), None)

    @property
    def version(self) -> object:
        """Another value after each change of any curve."""
        return [(store.version, store.share) for store in list(self._stores.values())]

    def fields(self, topic: str) -> list[str]:
        """Paths of a topic's numbers, by its newest or its first recorded message.

        Raises:
            BadCurve: no such topic, or no message yet.
        """
        if topic not in self._runtime.graph.topics:
            raise BadCurve(f"no such topic: {topic}")
        message = self._newest.newest(topic, 0 if topic in self._recorded else _WAIT_S)
        if message is None and self._reader is not None and topic in self._recorded:
            message = self._reader.first(self._recorded[topic], _WAIT_S)
        if message is None:
            raise BadCurve("no message yet")
        return list(fields_of(message))

    def begin(self, texts: Iterable[str]) -> None:
        """Begin with those of these curves that are new, all of one topic together."""
        texts = list(texts)
        named = [name for text in texts for name in _named(text).names]
        names = [name for name in dict.fromkeys(named) if name[0] in self._runtime.graph.topics]
        with self._lock:
            new = sorted({name for name in names if name not in self._stores})
            for topic, group in groupby(new, key=lambda name: name[0]):
                self._begin(topic, [path for _, path in group])
            for name in names:
                self._stores[name] = self._stores.pop(name)
            self._forget_oldest(set(names), texts)
        if any(topic not in self._recorded for topic, _ in names):
            self.live.keep()

    def curve(self, text: str) -> Curve:
        """A curve that was begun; expressions are computed anew after changes.

        Raises:
            BadCurve: it cannot be plotted.
        """
        named = _named(text)
        if named.error:
            raise BadCurve(named.error)
        for topic, _ in named.names:
            if topic not in self._runtime.graph.topics:
                raise BadCurve(f"no such topic: {topic}")
        with self._lock:
            stores = [self._stores[name] for name in named.names if name in self._stores]
        if len(stores) < len(named.names):
            raise BadCurve("the curves take too much memory; remove some")
        shares = [store.share for store in stores if store.share is not None]  # before the samples
        share = min(shares, default=None)
        error = next((store.error for store in stores if store.error), "")
        if named.expression is None:
            path = named.names[0][1]
            return Curve(stores[0], path, share, error, unit_of(path))
        unit = named.expression.unit(lambda name: unit_of(_parse(name)[1]))
        with self._deriving:
            store = self._compute(text, named.expression, named.names, stores)
        return Curve(store, _VALUE, share, error, unit)

    def rest(self, all_of_them: bool = False) -> None:
        """Append what has arrived; unsubscribe from topics that were not requested lately."""
        self._follow_line()
        self._newest.rest(all_of_them)
        self.live.take()
        self.live.rest(all_of_them)
        with self._lock:
            self._forget_oldest(set())

    def close(self) -> None:
        """Unsubscribe from all, and close the recording."""
        self.rest(all_of_them=True)
        if self._reader is not None:
            self._reader.close()

    def _recorded_curves(self) -> RecordedCurves:
        source: Any = self._runtime.graph.source
        params = self._runtime.parameters[source.name].current
        return RecordedCurves(partial(source.type.recording, params), [*self._recorded.values()])

    def _follow_line(self) -> None:
        """Read recorded curves anew where sources that are played together were moved."""
        line = None if self._runtime.playback is None else self._runtime.playback.recorded
        if self._reader is None or line is self._line:
            return
        with self._lock:
            self._line = line
            self._reader.close()
            self._reader = self._recorded_curves()
            self._stores = {n: one for n, one in self._stores.items() if n[0] not in self._recorded}

    def _begin(self, topic: str, paths: list[str]) -> None:
        is_live = topic not in self._recorded
        store = SampleStore(paths, None if is_live else 0.0)
        self._stores.update({(topic, path): store for path in paths})
        if is_live:
            self.live.add(topic, store)
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
                self.live.forget(name[0], store)
                self._stores = {n: one for n, one in self._stores.items() if one is not store}

    @property
    def _nbytes(self) -> int:
        """Size of all samples in memory, bytes."""
        derived = [store for _, store in list(self._derived.values())]
        every = {id(one): one.nbytes for one in (*list(self._stores.values()), *derived)}
        return sum(every.values())

    def _compute(
        self, text: str, expression: Expression, names: list[Name], stores: list[SampleStore]
    ) -> SampleStore:
        state = [(store, store.version) for store in stores]
        before, store = self._derived.get(text, (None, None))
        if store is None or before != state:
            if self._nbytes > self._most_bytes:
                raise BadCurve("the curves take too much memory; remove some")
            sources = {
                ":".join(name): (one, name[1]) for name, one in zip(names, stores, strict=True)
            }
            try:
                found = expression.compute(lambda name: _sampled(*sources[name]))
            except BadExpression as bad:
                raise BadCurve(str(bad)) from None
            store = SampleStore([_VALUE])
            store.add(found.times_s, found.values[:, None])
            self._derived.pop(text, None)
            self._derived[text] = state, store
            for name in list(self._derived)[:-_MAX_DERIVED]:
                del self._derived[name]
        return store


class _Named:
    """A curve by its name: a field, or an expression over several."""

    def __init__(self, text: str) -> None:
        self.error = ""
        self.expression: Expression | None = None
        self.names: list[Name] = []
        try:
            if not text.startswith(_EXPRESSION):
                self.names = [_parse(text)]
                return
            self.expression = Expression(text.removeprefix(_EXPRESSION))
            self.names = [_parse(name) for name in self.expression.names]
        except (BadExpression, BadCurve) as bad:
            self.error, self.names = str(bad), []


@lru_cache(1000)
def _named(text: str) -> _Named:
    return _Named(text)


def _sampled(store: SampleStore, path: str) -> Sampled:
    return Sampled(*store.whole(path))


def _parse(text: str) -> Name:
    topic, colon, path = text.rpartition(":")
    if not topic or not colon:
        raise BadCurve("give fields in the form TOPIC:FIELD, such as /odom:pose.pose.position.x")
    return topic, path


def _inverse(outputs: Any) -> dict[str, str]:
    return {topic: port for port, topic in outputs.items()}

"""Numeric fields of topics over the time of playback.

The curves of a recorded topic are whole from the start; those of other topics grow while a plot is
open.
"""

from __future__ import annotations

import math
import threading
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

from ros_visualise.data import Floats
from ros_visualise.runtime.base import Runtime
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.recordings.series import SeriesRecording
from ros_visualise.ui.look.answers import Answer, BrowserQuery, Refusal, as_json
from ros_visualise.ui.look.curve import Curve, LiveCurves, Name, RecordedCurves
from ros_visualise.ui.look.taps import Taps
from ros_visualise.ui.look.trees import fields_of

_MAX_CURVES = 24  # of one request
_KEPT = 100
_MAX_POINTS = 1500  # of a curve
_WAIT_S = 0.5


class Curves:
    """Answers requests for curves.

    Args:
        runtime: the runtime whose topics are plotted.
    """

    def __init__(self, runtime: Runtime) -> None:
        self._runtime = runtime
        self._newest = Taps(runtime, 1)
        self._live = LiveCurves(runtime)
        self._curves: dict[Name, Curve] = {}
        self._lock = threading.Lock()
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

        One that cannot be plotted is empty, with the reason.

        Raises:
            Refusal: malformed request.
        """
        names = [_parse(text) for text in query.texts("field")[:_MAX_CURVES]]
        start_s, end_s = query.seconds("from"), query.seconds("to")
        self._begin_new([name for name in names if not self._refusal(name[0])])
        self._live.take()
        found = [self._describe(name, start_s, end_s) for name in names]
        return as_json({"curves": found, **self._position()})

    def rest(self, all_of_them: bool = False) -> None:
        """Unsubscribe from topics that were not requested lately."""
        self._newest.rest(all_of_them)
        for name in self._live.rest(all_of_them):
            self._curves.pop(name, None)

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

    def _begin_new(self, names: list[Name]) -> None:
        """Begin with curves that are new, all of one topic together."""
        with self._lock:
            new = sorted({name for name in names if name not in self._curves})
            for topic, group in groupby(new, key=lambda name: name[0]):
                self._begin(topic, {path: Curve(None) for _, path in group})
            for name in list(self._curves)[:-_KEPT]:
                del self._curves[name]
        if any(self._is_live(topic) for topic, _ in names):
            self._live.keep()

    def _begin(self, topic: str, curves: dict[str, Curve]) -> None:
        self._curves.update({(topic, path): curve for path, curve in curves.items()})
        if self._is_live(topic):
            self._live.add(topic, curves)
            return
        assert self._reader is not None
        for curve in curves.values():
            curve.share = 0.0
        self._reader.fill(self._recorded[topic], curves)

    def _is_live(self, topic: str) -> bool:
        return topic not in self._recorded

    def _describe(self, name: Name, start_s: float, end_s: float) -> dict[str, Any]:
        curve = self._curves.get(name, Curve(1.0))
        times_s, values = curve.between(start_s, end_s, _MAX_POINTS)
        return {
            "name": ":".join(name),
            "times": _rounded(times_s),
            "values": _rounded(values),
            "share": curve.share,
            "error": curve.error or self._refusal(name[0]),
        }

    def _position(self) -> dict[str, Any]:
        """Position and length of playback."""
        playback = self._runtime.playback
        if playback is None:
            return {"position": self._live.now_s, "length": None, "playing": True}
        state = playback.state
        return {
            "position": state.position_s,
            "length": state.duration_s,
            "playing": state.playing,
        }


def _parse(text: str) -> Name:
    topic, _, path = text.rpartition(":")
    if not topic or not path:
        raise Refusal("give fields as /odom:pose.pose.position.x")
    return topic, path


def _inverse(outputs: Any) -> dict[str, str]:
    return {topic: port for port, topic in outputs.items()}


def _rounded(numbers: Floats) -> list[float | None]:
    """Numbers for JSON, which lacks NaN and infinities: those are null."""
    return [float(f"{n:.9g}") if math.isfinite(n) else None for n in numbers.tolist()]

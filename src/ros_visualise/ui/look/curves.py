"""Numbers of any topics over the time that is played.

Those of a recorded topic are there at once, from the first message to the last; those of what nodes
make, and of what is live, grow while somebody looks.
"""

from __future__ import annotations

import math
import threading
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

from ros_visualise.runtime.base import Runtime
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.recordings.series import SeriesRecording
from ros_visualise.ui.look.answers import Answer, Question, Refusal, as_json
from ros_visualise.ui.look.curve import Curve, Numbers
from ros_visualise.ui.look.decoding import Decoding
from ros_visualise.ui.look.growing import Growing
from ros_visualise.ui.look.taps import Taps
from ros_visualise.ui.look.trees import fields_of

_MOST = 24  # curves in one question
_KEPT = 100
_POINTS = 1500  # of a curve that are sent at most
_WAIT_S = 0.5

Name = tuple[str, str]
"""A topic and the path of a field."""


class Curves:
    """Answers with the numbers of a graph's topics over time.

    Args:
        runtime: what runs.
    """

    def __init__(self, runtime: Runtime) -> None:
        self._runtime = runtime
        self._newest = Taps(runtime, 1)
        self._growing = Growing(runtime)
        self._curves: dict[Name, Curve] = {}
        self._lock = threading.Lock()
        source = runtime.graph.source
        self._recorded: dict[str, str] = {}
        self._decoding: Decoding | None = None
        if source is not None and source.type.recording is not None:
            self._recorded = _inverse(source.outputs)
            played = list(self._recorded.values())
            self._decoding = Decoding(partial(open_recording, source.type.recording), played)
        elif source is not None and source.type.series:
            series = source.type.series
            measured = {one.topic for one in series}
            self._recorded = {t: p for t, p in _inverse(source.outputs).items() if p in measured}
            self._decoding = Decoding(lambda: SeriesRecording(Path(), "film", 0, series), None)

    @property
    def topics(self) -> list[str]:
        """The topics whose messages may hold numbers to be plotted."""
        topics: dict[str, Any] = {n: one.type for n, one in self._runtime.graph.topics.items()}
        return [name for name, kind in topics.items() if kind.plotted]

    def fields(self, question: Question) -> Answer:
        """The paths of a topic's numbers, by its newest message, or by the first that is recorded.

        Raises:
            Refusal: there is no such topic or message.
        """
        topic = question.text("topic")
        if refusal := self._refusal(topic):
            raise Refusal(refusal, 404)
        message = self._newest.newest(topic, _WAIT_S)
        if message is None and self._decoding is not None and not self._is_live(topic):
            message = self._decoding.first(self._recorded[topic], _WAIT_S)
        if message is None:
            raise Refusal("no message yet", 404)
        return as_json({"fields": list(fields_of(message))})

    def curves(self, question: Question) -> Answer:
        """The curves of fields as ``/odom:pose.pose.position.x``, from one second to another.

        One that cannot be drawn is empty and says why.

        Raises:
            Refusal: something else is asked for.
        """
        names = [_parse(text) for text in question.texts("field")[:_MOST]]
        there = [name for name in names if not self._refusal(name[0])]
        start_s, end_s = question.seconds("from"), question.seconds("to")
        self._provide(there)
        self._growing.take()
        found = [self._describe(name, start_s, end_s) for name in names]
        return as_json({"curves": found, **self._place()})

    def rest(self, all_of_them: bool = False) -> None:
        """Let go of topics that nobody asked for lately."""
        self._newest.rest(all_of_them)
        for name in self._growing.rest(all_of_them):
            self._curves.pop(name, None)

    def close(self) -> None:
        """Let go of all."""
        self.rest(all_of_them=True)
        if self._decoding is not None:
            self._decoding.close()

    def _refusal(self, topic: str) -> str:
        """Why a topic has no curves; empty if it has."""
        if topic not in self._runtime.graph.topics:
            return f"there is no topic {topic}"
        return "" if topic in self.topics else f"{topic} holds nothing to be plotted"

    def _provide(self, names: list[Name]) -> None:
        """Begin with those that are new, all of one topic together."""
        with self._lock:
            new = sorted({name for name in names if name not in self._curves})
            for topic, group in groupby(new, key=lambda name: name[0]):
                self._begin(topic, {path: Curve(None) for _, path in group})
            for name in list(self._curves)[:-_KEPT]:
                del self._curves[name]
        self._growing.keep({name for name in names if self._is_live(name[0])})

    def _begin(self, topic: str, curves: dict[str, Curve]) -> None:
        self._curves.update({(topic, path): curve for path, curve in curves.items()})
        if self._is_live(topic):
            for path, curve in curves.items():
                self._growing.add((topic, path), curve)
            return
        assert self._decoding is not None
        for curve in curves.values():
            curve.share = 0.0
        self._decoding.fill(self._recorded[topic], curves)

    def _is_live(self, topic: str) -> bool:
        return topic not in self._recorded

    def _describe(self, name: Name, start_s: float, end_s: float) -> dict[str, Any]:
        curve = self._curves.get(name, Curve(1.0))
        times_s, values = curve.between(start_s, end_s, _POINTS)
        return {
            "name": ":".join(name),
            "times": _rounded(times_s),
            "values": _rounded(values),
            "share": curve.share,
            "error": curve.error or self._refusal(name[0]),
        }

    def _place(self) -> dict[str, Any]:
        """Where playing is, and how long it is."""
        playback = self._runtime.playback
        if playback is None:
            return {"position": self._growing.now_s, "length": None, "playing": True}
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


def _rounded(numbers: Numbers) -> list[float | None]:
    """As JSON has them: what is no number is null."""
    return [float(f"{n:.9g}") if math.isfinite(n) else None for n in numbers.tolist()]

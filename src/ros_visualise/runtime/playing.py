"""The playback of a source as live parameters of its node, for graphs without a page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, make_dataclass
from typing import Any

from ros_visualise.core.params import Parameters, Value, param, specs
from ros_visualise.core.rate import MAX_RATE
from ros_visualise.nodes import NodeType, SourceType, find_all
from ros_visualise.sources.playback import Playback


@dataclass(frozen=True)
class LiveParams:
    """Playback of a live source, beside its own parameters."""

    paused: bool = param(False, "pause", saved=False)


@dataclass(frozen=True)
class PlayingParams(LiveParams):
    """Playback of a recording, beside the source's own parameters."""

    paused: bool = param(
        False,
        "pause; becomes true at the end; to play again from the start, set it back to false",
        saved=False,
    )
    rate: float = param(
        1.0,
        "playback speed; 0 is as fast as possible",
        min=0,
        max=MAX_RATE,
        slider=(0, 4),
        saved=False,
    )
    loop: bool = param(False, "start again when the end is reached (loop)", saved=False)


def playing_params(source: SourceType) -> type:
    """A source's parameters and those of its playback as one declaration."""
    bases = (LiveParams if source.live else PlayingParams, source.params)
    return make_dataclass(source.params.__name__, [], bases=bases, frozen=True)


def offered() -> Iterator[tuple[type, NodeType | SourceType]]:
    """The parameters that our own nodes may have on a graph, with their nodes."""
    for node in find_all():
        kinds = [node.params]
        if isinstance(node, SourceType):
            kinds.append(playing_params(node))
        yield from ((kind, node) for kind in kinds if specs(kind))


class PlaybackFollower:
    """Keeps a playback and its parameters equal, both ways."""

    def __init__(self, playback: Playback, parameters: Parameters[Any]) -> None:
        self._playback = playback
        self._parameters = parameters
        self._names = {spec.name for spec in specs(parameters.current)}
        if parameters.current.paused:
            playback.pause()
        self._seen = self._state()
        parameters.on_change(self._apply)

    def follow(self) -> None:
        """Take over changes by the keys of a window or on the page."""
        before, self._seen = self._seen, self._state()
        if moved := {name: now for name, now in self._seen.items() if now != before[name]}:
            self._parameters.update(moved)

    def _state(self) -> dict[str, Value]:
        state = self._playback.state
        every = {"rate": state.rate, "loop": state.loop, "paused": not state.playing}
        return {name: value for name, value in every.items() if name in self._names}

    def _apply(self, current: Any, changed: Mapping[str, Value]) -> None:
        """Take over the changed parameters alone: keys may have changed others meanwhile."""
        state = self._state()
        names = state.keys() & changed.keys()
        other = {name: value for name in names if (value := getattr(current, name)) != state[name]}
        if "rate" in other:
            self._playback.set_rate(other["rate"])
        if "loop" in other:
            self._playback.set_loop(other["loop"])
        if "paused" in other:
            self._playback.pause() if other["paused"] else self._playback.play()
        now = self._state()
        self._seen |= {name: now[name] for name in names}

"""Playing a source on a ROS graph: its playback as parameters of the node."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, make_dataclass
from typing import Any

from ros_visualise.params import Parameters, Value, param
from ros_visualise.sources.playback import Playback


@dataclass(frozen=True)
class PlayingParams:
    """How a recording is played; a source's own parameters come beside these."""

    rate: float = param(
        1.0, "speed of playing; 0 is as fast as it goes", min=0, max=100, slider=(0, 4)
    )
    loop: bool = param(False, "start over at the end")
    paused: bool = param(False, "stop at the image shown now")


def playing_params(source_params: type) -> type:
    """A source's parameters and those of its playback as one declaration."""
    bases = (PlayingParams, source_params)
    return make_dataclass(source_params.__name__, [], bases=bases, frozen=True)


class PlaybackFollower:
    """Keeps a playback and the parameters that stand for it in step, both ways."""

    def __init__(self, playback: Playback, parameters: Parameters[Any]) -> None:
        self._playback = playback
        self._parameters = parameters
        if parameters.current.paused:
            playback.pause()
        self._seen = self._state()
        parameters.on_change(self._apply)

    def follow(self) -> None:
        """Take over what was changed by the keys of a window or on the page."""
        before, self._seen = self._seen, self._state()
        if moved := {name: now for name, now in self._seen.items() if now != before[name]}:
            self._parameters.update(moved)

    def _state(self) -> dict[str, Value]:
        state = self._playback.state
        paused = not (state.playing or state.ended)
        return {"rate": state.rate, "loop": state.loop, "paused": paused}

    def _apply(self, current: Any, changed: Mapping[str, Value]) -> None:
        state = self._state()
        if current.rate != state["rate"]:
            self._playback.set_rate(current.rate)
        if current.loop != state["loop"]:
            self._playback.set_loop(current.loop)
        if "paused" in changed and current.paused != state["paused"]:
            self._playback.pause() if current.paused else self._playback.play()
        self._seen = self._state()

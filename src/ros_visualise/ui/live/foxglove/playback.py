"""State and control of playback, as viewers see them."""

from __future__ import annotations

from typing import NamedTuple

from ros_visualise.core.rate import MAX_RATE
from ros_visualise.sources.playback import PlaybackState
from ros_visualise.ui.live.foxglove.messages import BadRequest, ControlPlayback, playback_state
from ros_visualise.ui.live.played import PlaybackLine

_PLAYING, _PAUSED, _ENDED = 0, 1, 3
_NS = 1_000_000_000


class SeenState(NamedTuple):
    """State of a playback; changes of it are sent."""

    status: int
    rate: float
    epoch: int
    start_ns: int


def seen_state(line: PlaybackLine) -> SeenState:
    """The present state."""
    state = line.playback.state
    return SeenState(_status(state), state.rate, line.playback.epoch, line.time_ns(0))


def describe(line: PlaybackLine, did_seek: bool, request_id: str = "") -> bytes:
    """A message with the present state."""
    state = line.playback.state
    return playback_state(_status(state), line.now_ns, state.rate, did_seek, request_id)


def control(line: PlaybackLine, request: ControlPlayback) -> None:
    """Do what a viewer requests.

    Raises:
        BadRequest: an unsupported speed.
    """
    speed, playback = round(request.speed, 6), line.playback  # it was rounded to 32 bits
    state = playback.state
    if not 0 < speed <= MAX_RATE:
        raise BadRequest(f"speed {speed:g}: must be above 0 and at most {MAX_RATE}")
    if speed != state.rate:
        playback.set_rate(speed)
    if request.seek_ns is not None:
        playback.seek(line.place_ns(request.seek_ns) / _NS)
    if request.playing != state.playing:
        playback.play() if request.playing else playback.pause()


def _status(state: PlaybackState) -> int:
    if state.ended:
        return _ENDED
    return _PLAYING if state.playing else _PAUSED

"""Playback as viewers see and control it: on the line of the times that messages have."""

from __future__ import annotations

from typing import NamedTuple

from ros_visualise.core.rate import MAX_RATE
from ros_visualise.graph import Graph
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.playback import Playback, PlaybackState
from ros_visualise.sources.recordings.playing import PlayedTime, played_time
from ros_visualise.ui.live.foxglove.messages import BadRequest, ControlPlayback, playback_state

_PLAYING, _PAUSED, _ENDED = 0, 1, 3
_NS = 1_000_000_000


class SeenState(NamedTuple):
    """State of a playback; changes of it are sent."""

    status: int
    rate: float
    epoch: int
    start_ns: int


class PlaybackLine:
    """The playback of a source, with the times of its messages.

    Args:
        playback: plays the source.
        recorded: the times of a recording, whose messages keep them; None: those of playback.
    """

    def __init__(self, playback: Playback, recorded: PlayedTime | None) -> None:
        self._playback, self._recorded = playback, recorded

    @property
    def range_ns(self) -> tuple[int, int] | None:
        """The times of the first and the last message; None while the length is unknown."""
        duration_s = self._playback.state.duration_s
        if duration_s is None:
            return None
        return self._time_ns(0), self._time_ns(round(duration_s * _NS))

    @property
    def now_ns(self) -> int:
        """The present time."""
        return self._time_ns(self._playback.time_ns())

    @property
    def seen(self) -> SeenState:
        """The present state."""
        state = self._playback.state
        return SeenState(_status(state), state.rate, self._playback.epoch, self._time_ns(0))

    def describe(self, did_seek: bool, request_id: str = "") -> bytes:
        """A message with the present state."""
        state = self._playback.state
        now_ns = self._time_ns(round(state.position_s * _NS)) if did_seek else self.now_ns
        return playback_state(_status(state), now_ns, state.rate, did_seek, request_id)

    def control(self, request: ControlPlayback) -> None:
        """Do what a viewer requests.

        Raises:
            BadRequest: an unsupported speed.
        """
        speed, state = round(request.speed, 6), self._playback.state  # it was rounded to 32 bits
        if not 0 < speed <= MAX_RATE:
            raise BadRequest(f"speed {speed:g}: must be above 0 and at most {MAX_RATE}")
        if speed != state.rate:
            self._playback.set_rate(speed)
        if request.seek_ns is not None:
            self._playback.seek(self._place_ns(request.seek_ns) / _NS)
        if request.playing != state.playing:
            self._playback.play() if request.playing else self._playback.pause()

    def _time_ns(self, place_ns: int) -> int:
        if self._recorded is not None:
            return self._recorded.stamp_ns(place_ns)
        return place_ns + self._playback.start_stamp_ns

    def _place_ns(self, time_ns: int) -> int:
        if self._recorded is not None:
            return self._recorded.place_ns(time_ns)
        return time_ns - self._time_ns(0)


def playback_line(graph: Graph, playback: Playback | None) -> PlaybackLine | None:
    """The line of a graph's source; None if it is live.

    Raises:
        RosVisualiseError, OSError: its recording can no longer be read.
    """
    if playback is None or graph.source is None or graph.live or playback.live_stamps:
        return None
    path = graph.source.type.recording
    if path is None:
        return PlaybackLine(playback, None)
    recording = open_recording(path)
    try:
        played = played_time(recording, list(graph.source.outputs))
    finally:
        recording.close()
    return PlaybackLine(playback, played)


def _status(state: PlaybackState) -> int:
    if state.ended:
        return _ENDED
    return _PLAYING if state.playing else _PAUSED

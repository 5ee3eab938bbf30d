"""The times of messages on the line of a playback, for all that shows both."""

from __future__ import annotations

from ros_visualise.graph import Graph
from ros_visualise.runtime.base import Runtime
from ros_visualise.sources.playback import Playback
from ros_visualise.sources.recordings import Recording

_NS = 1_000_000_000


class PlaybackLine:
    """The playback of a source, with the times of its messages.

    Args:
        playback: plays the source.

    Attributes:
        playback: the same.
    """

    def __init__(self, playback: Playback) -> None:
        self.playback = playback

    @property
    def range_ns(self) -> tuple[int, int] | None:
        """The times of the first and the last message; None while the length is unknown."""
        duration_s = self.playback.state.duration_s
        if duration_s is None:
            return None
        return self.time_ns(0), self.time_ns(round(duration_s * _NS))

    @property
    def now_ns(self) -> int:
        """The present time."""
        return self.time_ns(self.playback.time_ns())

    def time_ns(self, place_ns: int) -> int:
        """The time of messages at a place, which counts from the start of the source."""
        if self.playback.recorded is not None:
            return self.playback.recorded.stamp_ns(place_ns)
        return place_ns + self.playback.start_stamp_ns

    def place_ns(self, time_ns: int) -> int:
        """The place of a time."""
        if self.playback.recorded is not None:
            return self.playback.recorded.place_ns(time_ns)
        return time_ns - self.playback.start_stamp_ns


def open_played(runtime: Runtime) -> Recording | None:
    """The recording or film that is played, opened once more; None for other sources.

    Raises:
        RosVisualiseError, OSError: it can no longer be read.
    """
    source = runtime.graph.source
    if source is None or source.type.recording is None or runtime.playback is None:
        return None
    return source.type.recording(runtime.parameters[source.name].current)


def recorded_ns(runtime: Runtime, place_s: float) -> int:
    """The stamp in that recording of a place, which counts from the start of the playback."""
    place_ns = round(place_s * _NS)
    recorded = None if runtime.playback is None else runtime.playback.recorded
    return place_ns if recorded is None else recorded.stamp_ns(place_ns)


def playback_line(graph: Graph, playback: Playback | None) -> PlaybackLine | None:
    """The line of a graph's source; None if it is live."""
    if playback is None or graph.source is None or graph.live or playback.live_stamps:
        return None
    return PlaybackLine(playback)

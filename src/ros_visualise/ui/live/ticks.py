"""The places of messages on the timeline, by topic."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from typing import Any

import numpy as np

from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.live.played import playback_line

_BINS = 500
_MOST_TOPICS = 200
_NS = 1_000_000_000


def ticks(runtime: Runtime) -> Mapping[str, Any]:
    """Topic -> number of messages in each of 500 equal parts of the recording.

    Empty for sources other than recordings.

    Raises:
        RosVisualiseError, OSError: the recording can no longer be read.
    """
    source, line = runtime.graph.source, playback_line(runtime.graph, runtime.playback)
    open_it = None if source is None else source.type.recording
    if source is None or open_it is None or line is None or not line.playback.state.duration_s:
        return {"topics": {}}
    with closing(open_it(runtime.parameters[source.name].current)) as recording:
        stamps = recording.stamps_ns()
    edges = np.linspace(0, line.playback.state.duration_s * _NS, _BINS + 1)
    limits_ns = [line.time_ns(round(edge)) for edge in edges]
    limits_ns[-1] += 1  # the last message counts too
    return {
        "topics": {
            topic: np.diff(np.searchsorted(np.sort(found), limits_ns)).tolist()
            for topic, found in sorted(stamps.items())[:_MOST_TOPICS]
        }
    }

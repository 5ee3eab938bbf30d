"""The places of messages on the timeline, by topic."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from contextlib import closing
from typing import Any

import numpy as np

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.live.played import open_played, recorded_ns

log = logging.getLogger(__name__)

_BINS = 500
_MOST_TOPICS = 200


def ticks(runtime: Runtime) -> Mapping[str, Any]:
    """Topic -> number of messages in each of 500 equal parts of the recording or film.

    Empty for other sources, and where the recording can no longer be read, which is logged.
    """
    try:
        recording = open_played(runtime)
        if recording is None or runtime.playback is None:
            return {"topics": {}}
        with closing(recording):
            stamps = recording.stamps_ns()
    except (RosVisualiseError, OSError) as error:
        log.warning("%s", error)
        return {"topics": {}}
    edges_s = np.linspace(0, runtime.playback.state.duration_s or 0, _BINS + 1).tolist()
    limits_ns = [recorded_ns(runtime, edge_s) for edge_s in edges_s]
    limits_ns[-1] += 1  # the last message counts too
    return {
        "topics": {
            topic: np.diff(np.searchsorted(np.sort(found), limits_ns)).tolist()
            for topic, found in sorted(stamps.items())[:_MOST_TOPICS]
        }
    }
